#include "server/jobs/making/error_budget.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>

#include "proto/parameters.h"
#include "server/codec/draco/grid.h"
#include "server/codec/formats.h"

namespace isomesh::jobs {
namespace {

// With more for smoothing, simplification gets too little; with less, steps of voxels remain.
constexpr double kSmoothingShare = 0.5;
constexpr double kQuantisationShare = 0.1;
constexpr int kMostBits = 30;  // of Draco

// Single precision moves a decoded coordinate by a few units of the largest one's last place.
double rounding_mm(const codec::Grid& grid) {
  double largest = 0;
  for (const float low : grid.low) {
    largest = std::max({largest, std::abs(double{low}), std::abs(double{low} + grid.side)});
  }
  return 4 * largest * std::numeric_limits<float>::epsilon();
}

// The grid of the mesh after its vertices were moved.
codec::Grid grid_of(const mesh::Mesh& mesh, int bits, double moved_mm) {
  codec::Grid grid = codec::grid_of(mesh, bits);
  for (auto& low : grid.low) low -= static_cast<float>(moved_mm);
  grid.side += static_cast<float>(2 * moved_mm);
  return grid;
}

double quantisation_of(const codec::Grid& grid) {
  const double step = grid.side / (std::pow(2.0, grid.bits) - 1);
  return std::sqrt(3.0) / 2 * step + rounding_mm(grid);
}

}  // namespace

bool is_simplified(const MeshParameters& parameters) {
  return parameters.max_error_mm || parameters.triangles;
}

MeshCertificate::Reference error_reference(const MeshParameters& parameters) {
  using Reference = MeshCertificate::Reference;
  return parameters.labels && is_simplified(parameters) ? Reference::kSmoothed
                                                        : Reference::kExtracted;
}

bool has_rounded_files(const MeshParameters& parameters) {
  return std::ranges::any_of(files_of(parameters),
                             [&](MeshFormat file) { return codec::rounds(file, parameters); });
}

bool has_exact_files(const MeshParameters& parameters) {
  return std::ranges::any_of(files_of(parameters),
                             [&](MeshFormat file) { return !codec::rounds(file, parameters); });
}

mesh::Rounding rounding_of(const MeshParameters& parameters, const mesh::Mesh& mesh) {
  const codec::Grid grid = codec::grid_of(mesh, parameters.draco.position_bits);
  const auto rounded = [grid](const mesh::Vec3& at) {
    return mesh::Vec3{grid.decoded(at[0], 0), grid.decoded(at[1], 1), grid.decoded(at[2], 2)};
  };
  return {.rounded = rounded, .most_mm = quantisation_of(grid)};
}

double most_displacement(const MeshParameters& parameters) {
  constexpr double kUnbounded = std::numeric_limits<double>::infinity();
  const double asked = parameters.max_displacement_mm.value_or(kUnbounded);
  const bool counts_smoothing =
      error_reference(parameters) == MeshCertificate::Reference::kExtracted;
  if (!parameters.max_error_mm || !counts_smoothing) return asked;
  return std::min(asked, kSmoothingShare * *parameters.max_error_mm);
}

MeshParameters with_bits_for(const MeshParameters& parameters, const mesh::Mesh& mesh) {
  MeshParameters result = parameters;
  if (!parameters.max_error_mm || !has_rounded_files(parameters)) return result;
  int& bits = result.draco.position_bits;
  const double most = kQuantisationShare * *parameters.max_error_mm;
  // Simplification may move vertices so far.
  codec::Grid grid = grid_of(mesh, bits, *parameters.max_error_mm);
  for (; quantisation_of(grid) > most; grid.bits = bits) {
    if (bits == kMostBits) {
      throw invalid_parameter(
          "max_error_mm",
          number_text(*parameters.max_error_mm) +
              " is finer than Draco's coordinates can represent on a surface of this size");
    }
    ++bits;
  }
  return result;
}

double quantisation_mm(const MeshParameters& parameters, const mesh::Mesh& mesh, double moved_mm) {
  if (!has_rounded_files(parameters) || mesh.positions.size() == 0) return 0;
  return quantisation_of(grid_of(mesh, parameters.draco.position_bits, moved_mm));
}

std::vector<MeshFormat> measured_formats(const MeshParameters& parameters) {
  std::vector<MeshFormat> formats = files_of(parameters);
  if (std::erase(formats, MeshFormat::kZip) > 0) {
    std::ranges::copy(zipped_formats(parameters), std::back_inserter(formats));
  }
  std::vector<MeshFormat> measured;
  bool has_exact = false;
  for (const MeshFormat format : formats) {
    const bool is_exact = !codec::rounds(format, parameters);
    if (!is_exact || !has_exact) measured.push_back(format);
    has_exact = has_exact || is_exact;
  }
  return measured;
}

}  // namespace isomesh::jobs
