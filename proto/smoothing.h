// The methods of smoothing. A new one is an enumerator and a row here, and its steps in
// server/mesh/smooth/methods.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

namespace isomesh {

enum class Smoothing { kLaplacian, kTaubin, kAngle, kOptimize, kLabels };

struct SmoothingRow {
  Smoothing smoothing;
  const char* name;     // of the API
  const char* meaning;  // in one line
  const char* more;     // sentences for readers of the API
  // The default relaxation factor: the fraction of the way to the mean of its neighbours that a
  // vertex moves. Empty if the method uses none.
  std::optional<double> lambda = {};
  std::optional<double> most_lambda = {};       // beyond it the method amplifies noise
  std::optional<double> lambda_by_labels = {};  // if it differs
  bool has_pass_band = false;
  bool is_for_labels_only = false;
};

inline constexpr std::array kSmoothings = {
    SmoothingRow{.smoothing = Smoothing::kLaplacian,
                 .name = "laplacian",
                 .meaning = "Shrinks the surface a little with every pass",
                 .more = "`laplacian`: each pass moves every vertex towards the mean of its "
                         "neighbours by the factor `lambda`; the enclosed volume shrinks.",
                 .lambda = 1,
                 // Factor 1 keeps the steps between half-way vertices, and takes 0.5 to 1 % off the
                 // volume of labels in ten passes. Factor 1/3 evens out the steps, and takes a
                 // third of a percent.
                 .lambda_by_labels = 0.33},
    SmoothingRow{.smoothing = Smoothing::kTaubin,
                 .name = "taubin",
                 .meaning = "Keeps the enclosed volume",
                 .more = "`taubin`: each pass does the same and then moves all vertices back by "
                         "the factor `mu`, where 1/lambda + 1/mu = `pass_band`. A pass is thus two "
                         "steps: they remove noise and keep shape and volume.",
                 // A third, after Taubin: larger factors move the brain's volume by more than 0.1 %
                 // in 20 passes.
                 .lambda = 0.33,
                 // Above it the highest frequencies grow in every pass, whatever the pass-band.
                 .most_lambda = 0.66,
                 .has_pass_band = true},
    SmoothingRow{.smoothing = Smoothing::kAngle,
                 .name = "angle",
                 .meaning = "Evens out the angles of triangles, and keeps shape and volume",
                 .more = "`angle` and `optimize` keep shape and volume and make the angles of "
                         "triangles larger: each pass moves every vertex along the extracted "
                         "surface. Neither uses `lambda`, and neither removes noise. `angle` moves "
                         "it towards the bisectors of its neighbours' angles."},
    SmoothingRow{.smoothing = Smoothing::kOptimize,
                 .name = "optimize",
                 .meaning = "Enlarges the smallest angles of triangles, and keeps shape and volume",
                 .more = "`optimize` moves it towards the mean of its neighbours in the first half "
                         "of the passes, and then to wherever the smallest angle becomes larger."},
    SmoothingRow{.smoothing = Smoothing::kLabels,
                 .name = "labels",
                 .meaning = "For labels: no steps of voxels, and each label's own volume",
                 .more = "`labels` is for labels alone: it takes the steps of the voxels away, "
                         "keeps flat faces, and gives each label the volume of its voxels, to a "
                         "few tenths of a percent; of a few voxels, to some percent.",
                 .lambda_by_labels = 0.33,
                 .is_for_labels_only = true}};

constexpr const SmoothingRow& row_of(Smoothing smoothing) {
  return kSmoothings[static_cast<std::size_t>(smoothing)];
}

static_assert([] {
  for (std::size_t i = 0; i < kSmoothings.size(); ++i) {
    if (static_cast<std::size_t>(kSmoothings[i].smoothing) != i) return false;
  }
  return true;
}());

}  // namespace isomesh
