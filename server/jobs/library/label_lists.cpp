#include "server/jobs/library/label_lists.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <type_traits>
#include <unordered_map>

#include "proto/samples.h"
#include "server/jobs/library/intact_volume.h"
#include "server/jobs/library/label_samples.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/parallel.h"
#include "server/volume/canonical.h"
#include "server/volume/labels.h"

namespace isomesh::jobs {
namespace {

using mesh::LabelVoxels;
using Dims = std::array<std::uint32_t, 3>;

// A box of samples that are contiguous in the file.
struct Block {
  Dims first;
  Dims dims;

  std::size_t samples() const { return std::size_t{dims[0]} * dims[1] * dims[2]; }
};

// Divides a volume into blocks: parts of a row or plane, whole planes, or the whole volume; as
// large as the limit allows.
class Blocks {
 public:
  Blocks(const Dims& dims, std::uint64_t most_samples) : dims_(dims) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint64_t step = std::clamp<std::uint64_t>(most_samples, 1, dims[axis]);
      step_[axis] = static_cast<std::uint32_t>(step);
      counts_[axis] = (dims[axis] + step - 1) / step;
      most_samples = step < dims[axis] ? 1 : most_samples / step;
    }
  }

  std::size_t count() const { return counts_[0] * counts_[1] * counts_[2]; }

  Block operator[](std::size_t index) const {
    Block block = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      block.first[axis] = static_cast<std::uint32_t>(index % counts_[axis] * step_[axis]);
      block.dims[axis] = std::min(step_[axis], dims_[axis] - block.first[axis]);
      index /= counts_[axis];
    }
    return block;
  }

  // The offset of the block's first sample, in samples.
  std::uint64_t place(const Block& block) const {
    return (std::uint64_t{block.first[2]} * dims_[1] + block.first[1]) * dims_[0] + block.first[0];
  }

 private:
  Dims dims_;
  Dims step_ = {};
  std::array<std::uint64_t, 3> counts_ = {};
};

using Table = std::unordered_map<std::int64_t, LabelVoxels>;

void add_to(Table& table, const LabelVoxels& label) {
  constexpr std::size_t kMostValues = Volume::kMostLabels + 1;  // with the background
  mesh::add_voxels(label, table[label.label]);
  if (table.size() > kMostValues) mesh::throw_too_many_labels();
}

// The type in which labels are counted.
template <class Sample>
using Counted = std::conditional_t<std::is_integral_v<Sample>, Sample, std::int32_t>;

// Reads samples; rounds floats. Throws if one is not nearly whole.
template <class Sample>
void read_labels(const volume::CanonicalFile& canonical, std::uint64_t place,
                 std::vector<Counted<Sample>>& labels) {
  if constexpr (std::is_integral_v<Sample>) {
    canonical.read(place * sizeof(Sample), std::as_writable_bytes(std::span(labels)));
  } else {
    std::vector<Sample> samples(labels.size());
    canonical.read(place * sizeof(Sample), std::as_writable_bytes(std::span(samples)));
    volume::round_labels(std::span<const Sample>(samples), labels.data());
  }
}

template <class Sample>
void count_block(const volume::CanonicalFile& canonical, std::uint64_t place, const Block& block,
                 std::vector<Counted<Sample>>& samples, Table& table) {
  samples.resize(block.samples());
  read_labels<Sample>(canonical, place, samples);
  const mesh::Lattice<Counted<Sample>> lattice = {
      samples.data(), {block.dims[0], block.dims[1], block.dims[2]}, {}};
  for (LabelVoxels label : mesh::count_labels(lattice, {})) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      label.low[axis] += block.first[axis];
      label.high[axis] += block.first[axis];
    }
    add_to(table, label);
  }
}

double voxel_mm3(const Volume& volume) {
  return std::abs(mesh::lattice_to_space(volume.geometry).determinant());
}

// All distinct values of the samples, ascending. Takes a few megabytes per thread.
template <class Sample>
std::vector<LabelVoxels> count_labels(const volume::CanonicalFile& canonical,
                                      const Volume& volume) {
  constexpr std::uint64_t kBytesAtOnce = std::uint64_t{4} << 20;
  const Blocks blocks(canonical.header().dims, kBytesAtOnce / sizeof(Sample));
  const std::size_t parts =
      std::min(blocks.count(), static_cast<std::size_t>(mesh::thread_count()));
  std::vector<Table> tables(parts);
  mesh::parallel_for({}, parts, [&](std::size_t part) {
    std::vector<Counted<Sample>> samples;
    for (std::size_t at = part; at < blocks.count(); at += parts) {
      const Block block = blocks[at];
      count_block<Sample>(canonical, blocks.place(block), block, samples, tables[part]);
    }
  });
  for (std::size_t part = 1; part < parts; ++part) {
    for (const auto& [value, label] : tables[part]) {
      LabelVoxels with_value = label;
      with_value.label = value;
      add_to(tables[0], with_value);
    }
  }
  std::vector<LabelVoxels> labels;
  for (auto& [value, label] : tables[0]) {
    label.label = value;
    label.volume_mm3 = static_cast<double>(label.voxels) * voxel_mm3(volume);
    labels.push_back(label);
  }
  std::ranges::sort(labels, {}, &LabelVoxels::label);
  return labels;
}

std::vector<LabelVoxels> count_labels(const volume::CanonicalFile& canonical,
                                      const Volume& volume) {
  return with_sample(
      volume.type, [&](auto sample) { return count_labels<decltype(sample)>(canonical, volume); });
}

// Corners of the bounding box of these voxels, in millimetres. A voxel extends half a step around
// its sample.
std::array<std::array<double, 3>, 2> bounds_of(const LabelVoxels& voxels,
                                               const mesh::LatticeToSpace& to_space) {
  std::array<std::array<double, 3>, 2> bounds;
  for (std::size_t row = 0; row < 3; ++row) {
    const std::array<double, 3> steps = {to_space.step_x[row], to_space.step_y[row],
                                         to_space.step_z[row]};
    bounds[0][row] = bounds[1][row] = to_space.origin[row];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double first = steps[axis] * (voxels.low[axis] - 0.5);
      const double last = steps[axis] * (voxels.high[axis] + 0.5);
      bounds[0][row] += std::min(first, last);
      bounds[1][row] += std::max(first, last);
    }
  }
  return bounds;
}

VolumeLabels list_of(const std::vector<LabelVoxels>& counts, const Volume& volume,
                     std::int64_t background) {
  const mesh::LatticeToSpace to_space = mesh::lattice_to_space(volume.geometry);
  VolumeLabels list = {.volume = volume.id, .background = background, .labels = {}};
  for (const LabelVoxels& voxels : mesh::labels_of(counts, background, values_of(volume))) {
    VolumeLabel& label = list.labels.emplace_back();
    label = {.label = voxels.label,
             .voxels = voxels.voxels,
             .volume_mm3 = voxels.volume_mm3,
             .low = voxels.low,
             .high = voxels.high,
             .bounds = bounds_of(voxels, to_space)};
    const auto entry =
        std::ranges::lower_bound(volume.labels, voxels.label, {}, &LabelEntry::label);
    if (entry == volume.labels.end() || entry->label != voxels.label) continue;
    if (!entry->name.empty()) label.name = entry->name;
    label.color = entry->color;
  }
  return list;
}

}  // namespace

std::shared_ptr<const std::vector<LabelVoxels>> LabelLists::counts(const store::Viewer& viewer,
                                                                   const Volume& volume) {
  return counts_.get({viewer, volume.id}, [&] {
    const store::LocalBlob file = intact_volume(blobs_, volume.samples);
    return make_from_volume(blobs_, volume.samples, {},
                            [&] { return count_labels(volume::CanonicalFile(file.path), volume); });
  });
}

VolumeLabels LabelLists::of(const store::Viewer& viewer, const Volume& volume,
                            std::int64_t background) {
  check_background(volume, background);
  return list_of(*counts(viewer, volume), volume, background);
}

VolumeLabels LabelLists::page_of(const store::Viewer& viewer, const Volume& volume,
                                 std::int64_t background, std::optional<std::int64_t> after) {
  const auto list =
      lists_.get({viewer, volume.id, background}, [&] { return of(viewer, volume, background); });
  const auto& all = list->labels;
  const auto begin =
      after ? std::ranges::upper_bound(all, *after, {}, &VolumeLabel::label) : all.begin();
  const auto left = static_cast<std::size_t>(all.end() - begin);
  const std::size_t count = std::min(left, MeshSummary::kMostListedLabels);
  VolumeLabels page = {.volume = list->volume,
                       .background = background,
                       .labels = {begin, begin + static_cast<std::ptrdiff_t>(count)}};
  if (count < left) page.next = std::to_string(page.labels.back().label);
  return page;
}

}  // namespace isomesh::jobs
