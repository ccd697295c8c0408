#include "server/mesh/smooth/methods.h"

#include <algorithm>
#include <array>

namespace isomesh::mesh {
namespace {

using Passes = PassStep::Passes;

double whole(const Relaxation& /*relaxation*/) { return 1; }
double lambda(const Relaxation& relaxation) { return relaxation.lambda; }
double mu(const Relaxation& relaxation) {
  return taubin_mu(relaxation.lambda, relaxation.pass_band);
}

constexpr std::array kLaplacian = {PassStep{Move::kMean, lambda}};
constexpr std::array kTaubin = {PassStep{Move::kMean, lambda}, PassStep{Move::kMean, mu}};
constexpr std::array kAngle = {PassStep{Move::kBisectors, whole}};
constexpr std::array kOptimize = {PassStep{Move::kTangentialMean, whole, Passes::kFirstHalf},
                                  PassStep{Move::kLargestAngle, whole, Passes::kSecondHalf}};
constexpr std::array kLabels = {PassStep{Move::kRemoveStairs, whole}};

constexpr std::array kMethods = {SmoothingMethod{.smoothing = Smoothing::kLaplacian,
                                                 .pass = kLaplacian,
                                                 .ms_per_triangle = 1.0e-5,
                                                 .ms_per_triangle_and_pass = 3.0e-6},
                                 SmoothingMethod{.smoothing = Smoothing::kTaubin,
                                                 .pass = kTaubin,
                                                 .ms_per_triangle = 1.0e-5,
                                                 .ms_per_triangle_and_pass = 3.0e-6},
                                 SmoothingMethod{.smoothing = Smoothing::kAngle,
                                                 .pass = kAngle,
                                                 .at_curves = AtCurves::kStay,
                                                 .ms_per_triangle = 1.0e-5,
                                                 .ms_per_triangle_and_pass = 6.0e-5},
                                 SmoothingMethod{.smoothing = Smoothing::kOptimize,
                                                 .pass = kOptimize,
                                                 .at_curves = AtCurves::kStay,
                                                 .ms_per_triangle = 1.0e-5,
                                                 .ms_per_triangle_and_pass = 6.0e-5},
                                 SmoothingMethod{.smoothing = Smoothing::kLabels,
                                                 .pass = kLabels,
                                                 .ms_per_triangle = 1.4e-3,
                                                 .ms_per_triangle_and_pass = 0}};

static_assert(std::ranges::equal(kMethods, kSmoothings, {}, &SmoothingMethod::smoothing,
                                 &SmoothingRow::smoothing));

bool is_in(Passes which, int pass, int passes) {
  const bool is_first_half = pass < passes / 2;
  return which == Passes::kAll || (which == Passes::kFirstHalf) == is_first_half;
}

}  // namespace

bool SmoothingMethod::is_unbounded() const {
  return std::ranges::any_of(pass, [](const PassStep& step) { return step.move == Move::kMean; });
}

std::vector<Step> SmoothingMethod::steps(int passes, const Relaxation& relaxation) const {
  std::vector<Step> steps;
  for (int n = 0; n < passes; ++n) {
    for (const PassStep& step : pass) {
      if (is_in(step.passes, n, passes)) steps.push_back({step.move, step.weight(relaxation)});
    }
  }
  return steps;
}

const SmoothingMethod& method_of(Smoothing smoothing) {
  return kMethods[static_cast<std::size_t>(smoothing)];
}

double taubin_mu(double lambda, double pass_band) { return 1 / (pass_band - 1 / lambda); }

}  // namespace isomesh::mesh
