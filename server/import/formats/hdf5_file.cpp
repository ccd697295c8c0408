#include "server/import/formats/hdf5_file.h"

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <utility>

#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMostRank = 8;
constexpr std::uint64_t kMostChunkBytes = std::uint64_t{256} << 20;
constexpr std::uint64_t kReadBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kMostNumbersRead = 1'000'000;

std::mutex& library() {
  static std::mutex mutex;
  return mutex;
}

[[noreturn]] void throw_damaged_file() { throw_unusable("The HDF5 file is damaged or truncated."); }

void check(bool done) {
  if (!done) throw_damaged_file();
}

hid_t open_file(const std::filesystem::path& path) {
  // Its messages would go to standard error, and its plugins are programs in other files.
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  H5PLset_loading_state(0);
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access.id(), false, true);
  return H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.id());
}

struct Hdf5Type {
  StoredType type;
  hid_t memory;  // the library's type for samples in memory
};

const std::array<Hdf5Type, 10>& hdf5_types() {
  static const std::array<Hdf5Type, 10> types = {{{StoredType::kUint8, H5T_NATIVE_UINT8},
                                                  {StoredType::kInt8, H5T_NATIVE_INT8},
                                                  {StoredType::kUint16, H5T_NATIVE_UINT16},
                                                  {StoredType::kInt16, H5T_NATIVE_INT16},
                                                  {StoredType::kUint32, H5T_NATIVE_UINT32},
                                                  {StoredType::kInt32, H5T_NATIVE_INT32},
                                                  {StoredType::kUint64, H5T_NATIVE_UINT64},
                                                  {StoredType::kInt64, H5T_NATIVE_INT64},
                                                  {StoredType::kFloat32, H5T_NATIVE_FLOAT},
                                                  {StoredType::kFloat64, H5T_NATIVE_DOUBLE}}};
  return types;
}

std::optional<StoredType> type_of(hid_t type) {
  for (const auto& [stored, memory] : hdf5_types()) {
    if (H5Tget_class(type) == H5Tget_class(memory) && H5Tget_size(type) == H5Tget_size(memory) &&
        H5Tget_sign(type) == H5Tget_sign(memory)) {
      return stored;
    }
  }
  return std::nullopt;
}

StoredType checked_type(hid_t dataset) {
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose);
  const auto found = type_of(type.id());
  if (found) return *found;
  throw_unusable("The HDF5 file's samples are not single numbers.");
}

hid_t memory_type(StoredType type) {
  return std::ranges::find(hdf5_types(), type, &Hdf5Type::type)->memory;
}

std::vector<std::uint64_t> sizes_of(hid_t dataset) {
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose);
  const int axes = H5Sget_simple_extent_ndims(space.id());
  check(axes >= 0 && static_cast<std::size_t>(axes) <= kMostRank);
  std::array<hsize_t, kMostRank> sizes = {};
  check(H5Sget_simple_extent_dims(space.id(), sizes.data(), nullptr) == axes);
  return {sizes.begin(), sizes.begin() + axes};
}

// Throws if reading would open other files, run unknown filters or allocate too much.
void check_storage(hid_t dataset, std::size_t bytes_each) {
  const Hdf5Handle created(H5Dget_create_plist(dataset), H5Pclose);
  const H5D_layout_t layout = H5Pget_layout(created.id());
  if (layout == H5D_VIRTUAL || H5Pget_external_count(created.id()) > 0) {
    throw_unusable("The HDF5 file's samples are in another file.");
  }
  if (layout != H5D_CHUNKED) return;
  std::array<hsize_t, kMostRank> chunk = {};
  const int axes = H5Pget_chunk(created.id(), kMostRank, chunk.data());
  check(axes >= 0 && static_cast<std::size_t>(axes) <= kMostRank);
  std::uint64_t bytes = bytes_each;
  for (int axis = 0; axis < axes; ++axis) {
    const std::uint64_t size = chunk[static_cast<std::size_t>(axis)];
    if (size == 0 || bytes > kMostChunkBytes / size) {
      throw_unusable("The HDF5 file's chunks of samples are larger than 256 MiB.");
    }
    bytes *= size;
  }
  const int filters = H5Pget_nfilters(created.id());
  for (int at = 0; at < filters; ++at) {
    unsigned flags = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(created.id(), static_cast<unsigned>(at), &flags,
                                               &values, nullptr, 0, nullptr, nullptr);
    if (filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE ||
        filter == H5Z_FILTER_FLETCHER32) {
      continue;
    }
    throw_unusable("The HDF5 file's samples are compressed by filter " + std::to_string(filter) +
                   ". Only deflate is supported.");
  }
}

}  // namespace

Hdf5Handle::Hdf5Handle(hid_t id, Close close) : id_(id), close_(close) { check(id >= 0); }

Hdf5Handle::Hdf5Handle(Hdf5Handle&& other) noexcept
    : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}

Hdf5Handle::~Hdf5Handle() {
  if (id_ >= 0) close_(id_);
}

Hdf5Array::Hdf5Array(Hdf5Handle dataset)
    : dataset_(std::move(dataset)),
      sizes_(sizes_of(dataset_.id())),
      type_(checked_type(dataset_.id())) {
  check_storage(dataset_.id(), bytes_per_sample(type_));
}

void Hdf5Array::read_box(std::span<const std::uint64_t> first, std::span<const std::uint64_t> size,
                         std::span<std::byte> target) const {
  std::array<hsize_t, kMostRank> start = {};
  std::array<hsize_t, kMostRank> count = {};
  std::ranges::copy(first, start.begin());
  std::ranges::copy(size, count.begin());
  const Hdf5Handle from(H5Dget_space(dataset_.id()), H5Sclose);
  const Hdf5Handle to(H5Screate_simple(static_cast<int>(size.size()), count.data(), nullptr),
                      H5Sclose);
  check(H5Sselect_hyperslab(from.id(), H5S_SELECT_SET, start.data(), nullptr, count.data(),
                            nullptr) >= 0);
  check(H5Dread(dataset_.id(), memory_type(type_), to.id(), from.id(), H5P_DEFAULT,
                target.data()) >= 0);
}

void Hdf5Array::read(std::uint64_t first, std::uint64_t count,
                     const std::function<void(std::span<const std::byte>)>& sink) const {
  const std::uint64_t bytes = bytes_per_sample(type_);
  if (sizes_.empty()) throw_damaged_file();
  // The slowest axes are walked; the faster ones are read whole, as far as a piece goes.
  std::size_t whole = sizes_.size();
  std::uint64_t inner = bytes;
  while (whole > 1 && inner <= kReadBytes / std::max<std::uint64_t>(sizes_[whole - 1], 1)) {
    inner *= sizes_[--whole];
  }
  const std::size_t walked = whole - 1;  // the axis of which several indices may be read at a time
  const std::uint64_t at_once = std::max<std::uint64_t>(kReadBytes / inner, 1);
  std::vector<std::uint64_t> place(sizes_.size(), 0);
  std::vector<std::uint64_t> box = sizes_;
  place[0] = first;
  std::fill_n(box.begin(), walked, 1);
  std::vector<std::byte> piece;
  const auto end = [&](std::size_t axis) { return axis == 0 ? first + count : sizes_[axis]; };
  const auto begin = [&](std::size_t axis) { return axis == 0 ? first : 0; };
  while (place[0] < end(0)) {
    box[walked] = std::min(at_once, end(walked) - place[walked]);
    piece.resize(box[walked] * inner);
    read_box(place, box, piece);
    sink(piece);
    place[walked] += box[walked];
    for (std::size_t axis = walked; axis > 0 && place[axis] == end(axis); --axis) {
      place[axis] = begin(axis);
      ++place[axis - 1];
    }
  }
}

std::vector<double> Hdf5Array::numbers() const {
  std::uint64_t count = 1;
  for (const std::uint64_t size : sizes_) {
    if (size == 0 || count > kMostNumbersRead / size) throw_damaged_file();
    count *= size;
  }
  std::vector<double> numbers(count);
  check(H5Dread(dataset_.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()) >=
        0);
  return numbers;
}

Hdf5File::Hdf5File(const std::filesystem::path& path)
    : lock_(library()), file_(open_file(path), H5Fclose) {}

bool Hdf5File::has(const std::string& path) const {
  for (std::size_t end = 0; end != std::string::npos;) {
    end = path.find('/', end + 1);
    H5L_info_t link;
    const std::string part = path.substr(0, end);
    const bool is_there = H5Lexists(file_.id(), part.c_str(), H5P_DEFAULT) > 0 &&
                          H5Lget_info(file_.id(), part.c_str(), &link, H5P_DEFAULT) >= 0;
    if (!is_there || link.type != H5L_TYPE_HARD) return false;
  }
  return true;
}

Hdf5Array Hdf5File::array(const std::string& path) const {
  if (!has(path)) throw_unusable("The HDF5 file has no array " + path + ".");
  // Pieces of a chunk are read one after the other.
  constexpr std::size_t kCacheSlots = 12421;
  constexpr std::size_t kCacheBytes = std::size_t{64} << 20;
  const Hdf5Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  H5Pset_chunk_cache(access.id(), kCacheSlots, kCacheBytes, 1);
  return Hdf5Array(Hdf5Handle(H5Dopen2(file_.id(), path.c_str(), access.id()), H5Dclose));
}

std::optional<Hdf5Handle> Hdf5File::open_attribute(const std::string& path,
                                                   const std::string& attribute) const {
  if (!has(path) ||
      H5Aexists_by_name(file_.id(), path.c_str(), attribute.c_str(), H5P_DEFAULT) <= 0) {
    return std::nullopt;
  }
  return Hdf5Handle(
      H5Aopen_by_name(file_.id(), path.c_str(), attribute.c_str(), H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
}

std::vector<double> Hdf5File::numbers(const std::string& path, const std::string& attribute) const {
  constexpr hssize_t kMost = 1000;
  const auto found = open_attribute(path, attribute);
  if (!found) return {};
  const Hdf5Handle type(H5Aget_type(found->id()), H5Tclose);
  const Hdf5Handle space(H5Aget_space(found->id()), H5Sclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space.id());
  if (!type_of(type.id()) || count < 1 || count > kMost) return {};
  std::vector<double> numbers(static_cast<std::size_t>(count));
  check(H5Aread(found->id(), H5T_NATIVE_DOUBLE, numbers.data()) >= 0);
  return numbers;
}

std::optional<std::string> Hdf5File::text(const std::string& path,
                                          const std::string& attribute) const {
  constexpr std::size_t kLongest = 4096;
  const auto found = open_attribute(path, attribute);
  if (!found) return std::nullopt;
  const Hdf5Handle type(H5Aget_type(found->id()), H5Tclose);
  const Hdf5Handle space(H5Aget_space(found->id()), H5Sclose);
  const std::size_t size = H5Tget_size(type.id());
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) != 0 ||
      H5Sget_simple_extent_npoints(space.id()) != 1 || size > kLongest) {
    return std::nullopt;
  }
  std::string text(size, '\0');
  check(H5Aread(found->id(), type.id(), text.data()) >= 0);
  return text.substr(0, text.find('\0'));
}

}  // namespace isomesh::import
