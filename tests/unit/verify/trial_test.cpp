// Random fields with specks beside what a job keeps: each mesh that the job calls proven passes,
// and each damaged one fails.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/step.h"
#include "tests/unit/verify/made.h"

namespace isomesh::test {
namespace {

using verify::Surface;
using verify::Vec;
using verify::operator+;
using verify::operator*;

class Trial {
 public:
  explicit Trial(std::uint32_t seed) : random_(seed), parameters_(parameters_within(0)) {
    parameters_.max_error_mm = spacing_ * number(0.1, 1.2);
    parameters_.scheme = is_so() ? SchemeName::kFive : SchemeName::kSix;
    parameters_.close = is_so();
    parameters_.fill_cavities = is_so();
    parameters_.passes = is_so() ? 0 : 2;
    if (seed % 4 != 0) parameters_.components.keep = 1 + random_() % 3;
    if (seed % 4 == 2) parameters_.components.min_triangles = 1 + random_() % 60;
    if (seed % 4 == 3) parameters_.components.nearest_to = {{place(), place(), place()}};
    volume_ = field();
  }

  const MeshParameters& parameters() const { return parameters_; }
  const SampleVolume<float>& volume() const { return volume_; }

  // The part of the volume's surface that the job keeps.
  Surface wanted() const {
    verify::Field field = field_of(volume_);
    verify::Cut cut;
    cut.tetrahedra = parameters_.scheme == SchemeName::kFive ? 5 : 6;
    cut.close = parameters_.close;
    if (parameters_.fill_cavities) verify::fill_cavities(cut, field);
    Surface surface = verify::zero_set(field, cut);
    verify::keep_components(parameters_.components, surface);
    return surface;
  }

  // Damages the mesh; returns a name for it, empty if it has nothing to damage in that way.
  std::string damage(std::size_t kind, const Surface& wanted, Surface& mesh) {
    const std::size_t t = random_() % mesh.triangles.size();
    const auto components = verify::components_of(mesh);
    const std::uint32_t one = components[mesh.triangles[t][0]];
    const auto is_of_one = [&](const verify::Indices& other) {
      return components[other[0]] == one;
    };
    switch (kind) {
      case 0:
        return move_out(mesh.triangles[t][0], wanted, mesh) ? "a vertex is too far" : "";
      case 1:
        if (std::ranges::all_of(mesh.triangles, is_of_one)) return "";
        std::erase_if(mesh.triangles, is_of_one);
        return "a component is missing";
      case 2:
        std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
        return "a triangle is turned";
      case 3:
        mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(t));
        return "a triangle is missing";
      case 4:
        mesh.triangles.push_back(mesh.triangles[t]);
        return "a triangle is there twice";
      default:
        for (Vec& point : mesh.points) point[random_() % 3] += 3 * *parameters_.max_error_mm;
        return "all is moved";
    }
  }

  static constexpr std::size_t kKinds = 6;

 private:
  bool is_so() { return random_() % 2 == 0; }
  double number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double place() { return number(0, 14 * spacing_); }

  // A ball or a shell with bumps, sometimes cut by the border, and specks of a sample or two
  // around.
  SampleVolume<float> field() {
    const Point centre = {number(5, 9), number(5, 9), number(4, 9)};
    const double radius = number(3, 5.5);
    const double hole = is_so() ? radius - number(1.2, 2.5) : 0;
    const double wave = number(0.3, 1.2);
    auto volume = sample<float>(
        [&](const Point& p) {
          const double r = std::hypot(p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]);
          const double bumps =
              0.6 * std::sin(wave * p[0]) * std::cos(wave * p[1] + 1) * std::sin(wave * p[2] + 2);
          return std::clamp(std::min(radius - r, hole > 0 ? r - hole : 9) + bumps, -1.5, 1.5);
        },
        {15, 14, 13}, Geometry{});
    for (int n = 0; n < 25; ++n) {
      const std::array<std::uint32_t, 3> at = {static_cast<std::uint32_t>(random_() % 15),
                                               static_cast<std::uint32_t>(random_() % 14),
                                               static_cast<std::uint32_t>(random_() % 13)};
      float& sample = volume.at(at[0], at[1], at[2]);
      sample = static_cast<float>(sample < 0 ? number(0.05, 1) : -number(0.05, 1));
    }
    volume.geometry.spacing = {spacing_, spacing_, spacing_};
    return volume;
  }

  bool move_out(std::uint32_t vertex, const Surface& wanted, Surface& mesh) {
    Vec out = {number(-1, 1), number(-1, 1), number(-1, 1)};
    out = 1 / std::sqrt(verify::squared(out)) * out;
    Surface copy = wanted;
    const verify::Tree tree(copy);
    const double bound = *parameters_.max_error_mm;
    const Vec from = mesh.points[vertex];
    for (double way = 0.1; way < 40; way *= 1.05) {
      mesh.points[vertex] = from + way * bound * out;
      const double distance = std::sqrt(tree.nearest(mesh.points[vertex], 0).squared);
      if (distance > 1.01 * bound) return true;
    }
    return false;
  }

  const double spacing_ = 0.7;
  std::mt19937 random_;
  MeshParameters parameters_;
  SampleVolume<float> volume_;
};

TEST(VerifyTrial, AcceptsWhatIsProvenAndRejectsWhatIsDamaged) {
  constexpr std::uint32_t kFields = 48;
  std::size_t proven = 0;
  std::size_t damaged = 0;
  // Other fields with --gtest_shuffle --gtest_random_seed=N.
  const std::uint32_t first =
      kFields * static_cast<std::uint32_t>(testing::UnitTest::GetInstance()->random_seed());
  for (std::uint32_t seed = first; seed < first + kFields; seed += kStep) {
    Trial trial(seed);
    const Made made = made_with_word(trial.volume(), trial.parameters());
    const Surface right = verify::read_surface(made.file);
    if (!made.is_proven || right.triangles.empty()) continue;
    ++proven;
    const verify::Verdict said = verdict(right, trial.volume(), trial.parameters());
    EXPECT_TRUE(said.holds) << "seed " << seed << "\n" << said.text;
    const Surface wanted = trial.wanted();
    for (std::size_t kind = 0; kind < Trial::kKinds; ++kind) {
      Surface mesh = right;
      const std::string name = trial.damage(kind, wanted, mesh);
      if (name.empty()) continue;
      ++damaged;
      const verify::Verdict found = verdict(mesh, trial.volume(), trial.parameters());
      EXPECT_FALSE(found.holds) << "seed " << seed << ": " << name << "\n" << found.text;
    }
  }
  RecordProperty("proven", std::to_string(proven));
  RecordProperty("damaged", std::to_string(damaged));
  EXPECT_GT(proven, kFields / kStep / 2);
  EXPECT_GT(damaged, 4 * proven);
}

}  // namespace
}  // namespace isomesh::test
