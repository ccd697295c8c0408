#include "server/mesh/labels/voxel_faces.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/mesh/labels/label_index.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kRowsPerTask = 2048;

class FaceTable {
 public:
  // The faces between a row and another one, sample by sample.
  void add(const PartNumber* row, const PartNumber* other, std::size_t count) {
    for (std::size_t begin = 0; begin < count; begin += kRun) {
      const std::size_t end = std::min(count, begin + kRun);
      // Neighbours mostly have the same label, so one comparison usually serves a whole run.
      PartNumber change = 0;
      for (std::size_t x = begin; x < end; ++x) {
        change = static_cast<PartNumber>(change | (row[x] ^ other[x]));
      }
      for (std::size_t x = begin; change != 0 && x < end; ++x) add(row[x], other[x]);
    }
  }

  void add(PartNumber one, PartNumber other) {
    if (one == other) return;
    const auto [low, high] = std::minmax(one, other);
    const std::uint32_t pair = std::uint32_t{low} << 16U | high;
    if (pair != last_ || count_ == nullptr) count_ = &counts_[last_ = pair];
    ++*count_;
  }

  void join_to(VoxelFaces& faces) const {
    for (const auto& [pair, count] : counts_) {
      faces[{static_cast<PartNumber>(pair >> 16U), static_cast<PartNumber>(pair & 0xffffU)}] +=
          count;
    }
  }

 private:
  static constexpr std::size_t kRun = 64;
  static_assert(sizeof(PartNumber) == 2, "two numbers are 32 bits");

  std::unordered_map<std::uint32_t, std::uint64_t> counts_;
  std::uint32_t last_ = 0;
  std::uint64_t* count_ = nullptr;  // of that pair
};

// A sample's faces to the next ones along x, y and z, so that each is counted once; and the ones in
// the border, if it is closed.
class FaceCounter {
 public:
  FaceCounter(const SampleParts& samples, bool close, FaceTable& table)
      : samples_(samples), dims_(samples.dims()), close_(close), table_(table) {
    for (auto* row : {&row_, &next_, &above_}) row->resize(dims_.x);
    nothing_.resize(dims_.x);
  }

  // The rows from `begin` on, of all planes together.
  void count_rows(std::size_t begin, std::size_t end) {
    for (std::size_t at = begin; at < end; ++at) {
      const auto z = static_cast<std::uint32_t>(at / dims_.y);
      const auto y = static_cast<std::uint32_t>(at % dims_.y);
      if (at == begin || y == 0) {
        samples_.copy_row(y, z, row_.data());
      } else {
        std::swap(row_, next_);
      }
      count_row(y, z);
    }
  }

 private:
  void count_row(std::uint32_t y, std::uint32_t z) {
    table_.add(row_.data(), row_.data() + 1, dims_.x - 1);
    if (y + 1 < dims_.y) {
      samples_.copy_row(y + 1, z, next_.data());
      add_to(next_);
    }
    if (z + 1 < dims_.z) {
      samples_.copy_row(y, z + 1, above_.data());
      add_to(above_);
    }
    if (!close_) return;
    for (const PartNumber end : {row_.front(), row_.back()}) table_.add(end, 0);
    for (const bool is_outermost : {y == 0, y + 1 == dims_.y, z == 0, z + 1 == dims_.z}) {
      if (is_outermost) add_to(nothing_);
    }
  }

  void add_to(const std::vector<PartNumber>& other) {
    table_.add(row_.data(), other.data(), dims_.x);
  }

  const SampleParts& samples_;
  const Dims dims_;
  const bool close_;
  FaceTable& table_;
  std::vector<PartNumber> row_;
  std::vector<PartNumber> next_;   // along y
  std::vector<PartNumber> above_;  // along z
  std::vector<PartNumber> nothing_;
};

}  // namespace

template <class T>
VoxelFaces count_faces(const Lattice<T>& lattice, const SeparateOptions& options,
                       const Context& context) {
  VoxelFaces faces;
  if (lattice.dims.samples() == 0) return faces;
  const LabelParts parts(options.labels, options.values);
  const PartsOf<T> samples(lattice, parts);
  Mutex mutex;
  const auto count = [&](std::size_t begin, std::size_t end) {
    FaceTable table;
    FaceCounter(samples, options.close, table).count_rows(begin, end);
    const Lock lock(mutex);
    table.join_to(faces);
  };
  for_chunks(context, std::size_t{lattice.dims.y} * lattice.dims.z, count, kRowsPerTask);
  return faces;
}

#define ISOMESH_INSTANTIATE(T) \
  template VoxelFaces count_faces(const Lattice<T>&, const SeparateOptions&, const Context&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
