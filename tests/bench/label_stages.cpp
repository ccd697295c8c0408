#include "tests/bench/label_stages.h"

#include <cstring>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "server/jobs/making/make_labels.h"
#include "server/mesh/stairs/stairs.h"
#include "server/mesh/stairs/unfold.h"

namespace isomesh::bench {
namespace {

// Calls use(lattice), which returns nothing.
template <class Use>
void with_lattice(const Samples& samples, Use use) {
  visit_samples(samples, [&]<class T>(const T* values) {
    if constexpr (std::is_integral_v<T>) {
      use(mesh::Lattice<T>{values, samples.dims, mesh::lattice_to_space(samples.geometry)});
    } else {
      throw std::runtime_error(samples.name + " is no segmentation: its samples are no integers");
    }
  });
}

}  // namespace

Samples padded(const Samples& samples) {
  Samples result = samples;
  const mesh::Dims from = samples.dims;
  result.dims = {from.x + 2, from.y + 2, from.z + 2};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.geometry.origin[axis] -= samples.geometry.spacing[axis];
  }
  const std::size_t sample = bytes_per_sample(samples.type);
  result.bytes.assign(result.dims.samples() * sample, std::byte{0});
  const std::size_t row = from.x * sample;
  for (std::size_t z = 0; z < from.z; ++z) {
    for (std::size_t y = 0; y < from.y; ++y) {
      const std::size_t to = ((z + 1) * result.dims.y + y + 1) * result.dims.x + 1;
      std::memcpy(result.bytes.data() + to * sample, samples.bytes.data() + (z * from.y + y) * row,
                  row);
    }
  }
  return result;
}

Samples load_labels(const std::filesystem::path& path) {
  Samples samples = load_volume(path).samples;
  with_lattice(samples, [](const auto&) {});
  samples.geometry.direction = Geometry{}.direction;
  samples.source = path.string();
  return padded(samples);
}

LabelStages::LabelStages(const Samples& samples, const MeshParameters& parameters)
    : samples_(samples), parameters_(parameters) {
  parameters_.formats = {MeshFormat::kGlb};
  with_lattice(samples, [&](const auto& lattice) {
    const auto present = mesh::count_labels(lattice, {});
    options_.labels = mesh::select_labels(present, 0);
    options_.scheme = scheme_of(parameters.scheme);
    options_.close = parameters.close;
    options_.regularize = parameters.regularize;
    for (const mesh::LabelVoxels& one : present) {
      if (one.label != 0) voxels_.push_back(one);
    }
  });
}

void LabelStages::count_voxels() const {
  with_lattice(samples_, [](const auto& lattice) { mesh::count_labels(lattice, {}); });
}

void LabelStages::extract() {
  with_lattice(samples_, [&](const auto& lattice) {
    count_ = mesh::count_walls(lattice, options_, {});
    mesh::extract_walls(lattice, options_, count_, {}, surface_);
  });
}

void LabelStages::remove_stairs() {
  with_lattice(samples_, [&](const auto& lattice) {
    mesh::remove_stairs(lattice, options_, std::numeric_limits<double>::infinity(), {}, surface_);
  });
}

std::size_t LabelStages::count_folded() const {
  const mesh::WallShape shape(surface_, samples_.dims, mesh::lattice_to_space(samples_.geometry),
                              options_.close, {});
  return mesh::count_folded(shape, {});
}

void LabelStages::smooth(const mesh::SmoothOptions& options) {
  mesh::smooth(options, {}, surface_.mesh);
}

std::vector<mesh::LabelMeasure> LabelStages::measure() const {
  return mesh::measure_labels(surface_, label_surfaces(surface_, {}), {});
}

JobFigures LabelStages::run_job(bool certify) {
  return bench::run_job(
      samples_, parameters_, 0, {.certify = certify},
      [&](const jobs::SampleArray& array, const jobs::MeshRequest& request,
          std::span<const codec::Sink> sinks, jobs::Progress& progress) {
        return jobs::make_labels(array, request, sinks, progress, surface_).summary;
      });
}

}  // namespace isomesh::bench
