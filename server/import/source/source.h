// A volume as its header describes it: everything except the samples.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/files.h"
#include "proto/types.h"
#include "server/import/source/gzip.h"
#include "server/import/source/names.h"
#include "server/import/source/stored_samples.h"

namespace isomesh::import {

// The number of leading bytes of a file that bound its size, and the resulting bounds.
inline constexpr std::size_t kBeginningBytes = std::size_t{1} << 20;
struct MostBytes {
  std::uint64_t file = 0;
  std::uint64_t data = 0;  // for each data file of its header
};

// White space between the numbers or words of a text.
inline bool is_space(char letter) {
  return letter == ' ' || letter == '\t' || letter == '\r' || letter == '\n';
}

enum class Encoding {
  kRaw,
  kDeflate,  // a gzip or zlib stream
  kBzip2,
  kText,          // numbers separated by white space
  kFractionText,  // the same: numbers from 0 to 1 stand for the bytes 0 to 255
  kHex,           // pairs of hexadecimal digits; white space is ignored
  kVtk,           // see VtkEncoding
  kHalf,          // floats of 16 bits, which become float32
  kBits,          // one bit a sample, the first highest in its byte, which become uint8
};

// VTK's encoding of an array: a header of counts, then the bytes, optionally compressed in blocks;
// all of it optionally in base64.
enum class VtkCompression { kNone, kZlib, kLz4, kXz };

struct VtkEncoding {
  bool base64 = false;
  VtkCompression compression = VtkCompression::kNone;
  bool wide_header = false;  // counts have 8 bytes instead of 4
  bool big_endian = false;
};

// An archive's files, by their normal paths in it.
using ArchiveFiles = std::map<std::string, std::filesystem::path, std::less<>>;

// The other files of the same archive, in the file's folder and its subfolders. Cheap to make, as
// an archive may have thousands of headers.
class Companions {
 public:
  // None, for a file that was uploaded alone.
  Companions() = default;
  // `member` is the file's path in the archive; `archive` must outlive this object.
  Companions(const ArchiveFiles& archive, const std::filesystem::path& member);

  // The name of the file itself, without folders; empty if it was uploaded alone.
  const std::string& name() const { return name_; }

  // The companion with that path, relative to the folder; null if there is none.
  const std::filesystem::path* find(const std::filesystem::path& path) const;

  // All companions, by their relative paths.
  ArchiveFiles all() const;

  // The relative paths of those below a folder, as `find` takes them; none for a path that leaves
  // the folder of the header.
  std::set<std::string> below(const std::string& folder) const;

 private:
  const ArchiveFiles* archive_ = nullptr;
  std::filesystem::path folder_;  // normal; empty at the top
  std::string name_;
};

// Returns the companion of that name, with or without "./". Throws Error kUnusableVolume if it is
// missing, or if the path leaves the header's folder.
const std::filesystem::path& companion(const std::string& name, const Companions& companions);

// The companion of the header `name` with one of these suffixes in place of the header's; empty if
// there is none.
std::optional<std::string> companion_with(std::initializer_list<std::string_view> suffixes,
                                          std::string_view name, const Companions& companions);

// A file of samples without a header.
struct DataFile {
  std::filesystem::path path;
  CompressedRange range;
  // Not empty: the file's own layout, whose canonical type is the type of the volume's samples.
  std::optional<SampleLayout> layout = {};
};

// The volume to read from a file. Volumes are consecutive, or take turns: `run` samples of the
// first, as many of the second, ...
struct VolumeOfFile {
  std::uint64_t index = 0;
  std::uint64_t count = 1;
  std::uint64_t run = 0;  // 0: consecutive
};

// The start of the samples in their decoded stream: bytes to skip, or, if empty, the samples are at
// its end.
using Skip = std::optional<std::uint64_t>;

// A segmentation with several layers, so that segments may overlap. A layer is one of the file's
// volumes.
struct SegmentLayers {
  bool is_interleaved = false;
  // A segment's label, by its layer and its value there. 0 is in no segment.
  std::map<std::pair<std::uint64_t, std::int64_t>, std::uint32_t> labels;
};

// The unit of a geometry that is no known length.
struct UnknownUnit {
  std::string why;          // a sentence
  bool is_assumed = false;  // one unit is read as one millimetre; otherwise the request must help
};

// The axes of a lattice as they are stored, the fastest first: 0 is x, 1 is y, 2 is z.
using StorageOrder = std::array<std::size_t, 3>;
inline constexpr StorageOrder kXFastest = {0, 1, 2};

struct SourceVolume {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  StorageOrder storage_order = kXFastest;
  VolumeOfFile chosen;
  SampleLayout layout;
  Encoding encoding = Encoding::kRaw;
  Skip decoded_skip = 0;    // for encoded samples
  CompressedRange payload;  // the samples' range, unless there are data files
  // The format has more data behind the samples, which no note reports.
  bool has_footer = false;
  VtkEncoding vtk;  // for Encoding::kVtk
  // For a detached header: the files with equal parts of the samples, in this order.
  std::vector<DataFile> data_files;
  // Without a spacing, the request must give one; `geometry` then has steps of 1.
  bool has_spacing = true;
  // The file gives no spacing, and `geometry` has the default of its format. The request may give
  // another one.
  bool assumes_spacing = false;
  // Then the request may give the spacing, and the origin stays as many samples away.
  std::optional<UnknownUnit> unknown_unit = {};
  Geometry geometry;
  std::vector<Note> notes;
  std::vector<LabelEntry> labels;  // see label_table()
  bool are_labels = false;         // by the header, even without a table
  bool is_segmentation = false;    // whole numbers; nothing lies beyond its ends
  // Many labels are those of the samples only if these look like labels.
  bool labels_if_flat = false;
  std::optional<SegmentLayers> layers;  // then all volumes are read, and `chosen` is the first

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  // The decoded size in the file of one volume, and of all volumes.
  std::uint64_t volume_bytes() const { return sample_count() * bytes_per_sample(layout.type); }
  std::uint64_t stored_bytes() const { return volume_bytes() * chosen.count; }
  // The size in a file of so many decoded bytes; empty if it depends on the samples.
  std::optional<std::uint64_t> packed_bytes(std::uint64_t decoded) const;
  // The largest encoded size, with generous white space.
  std::uint64_t most_encoded_bytes() const;
};

// From there to the end of the file.
CompressedRange range_from(const InputFile& file, std::uint64_t offset);

// Throws Error kTooLarge if the volume's canonical samples would exceed the limits.
void check_limits(const SourceVolume& volume, const SizeLimits& limits);

// Throws Error kInvalidParameter for the option `spacing` of a file that has its own.
void refuse_spacing(const ImportOptions& options);

// Throws Error kUnusableVolume if `what`, as in "The file", has only one sample along an axis. Such
// an image has no cells, so no surface at any iso-value.
void refuse_flat(std::string_view what, const std::array<std::uint32_t, 3>& dims);

// The offset behind so many lines from `offset` on, which may be of any length. Throws Error
// kUnusableVolume if the file ends before.
std::uint64_t skip_lines(const InputFile& file, std::uint64_t offset, std::uint64_t count);

// The beginning of a data file: lines of the file as it is, and then bytes of its decoded content.
struct DataSkip {
  std::uint64_t lines = 0;
  Skip bytes = 0;  // empty: the samples are at the end, whatever is before them
};

// A header's data files, in its order. Each has the same part of `volume`'s samples, after skipping
// `skip`. A single file may have less than a slice of trailing bytes, with a note in `volume`.
// Throws Error kUnusableVolume for a missing companion, for a wrong size, and if the samples'
// position is ambiguous.
std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const DataSkip& skip,
                                    SourceVolume& volume);

// True if that many trailing bytes may be ignored: some programs pad their last block. A whole
// slice means that the header describes another volume.
bool may_trail(std::uint64_t bytes, const SourceVolume& volume);
Note trailing_note(std::uint64_t bytes);

// For that many duplicate files, and the reason to ignore one of them.
Note duplicate_note(std::size_t files);
std::string reason_of_double(std::string_view first_name);

struct Difference {
  std::string what;                                       // for example "time"
  std::function<std::string(std::uint64_t index)> title;  // of one volume, for example "6 s"
};

// Volumes that are told apart by a number: "frame 0", "frame 1", ...
Difference numbered(const std::string& what, const std::string& name);

// The number of volumes of a file with these sizes. Throws Error kUnusableVolume for implausible
// numbers.
std::uint64_t volumes_beyond(std::span<const std::uint64_t> sizes);

// Selects one of `count` volumes, with a note if there are several. Throws Error kUnusableVolume
// with the choices if the options select none or one that does not exist.
void choose_volume(std::uint64_t count, const Difference& difference, const ImportOptions& options,
                   SourceVolume& volume);

// For so many flat images along an axis that is not one of space, such as "its axis of time".
// Throws Error kUnusableVolume, which `accept` overrides. If the options accept it, adds a note,
// and the images are the slices of a volume.
void accept_frames(std::uint64_t frames, const std::string& axis, const ImportOptions& options,
                   SourceVolume& volume);

// The same if the volumes of the file are flat images, which have `volume.dims`, and the options
// select none. Returns how many volumes are left: one, whose slices they are, or `count`.
std::uint64_t volumes_of_frames(std::uint64_t count, const std::string& axis,
                                const ImportOptions& options, SourceVolume& volume);

// The words, with a space before them, between the reason of an error and the parameter of a client
// that resolves it: `verb`, such as "Add". An order has no such parameter, so its series must be
// uploaded.
std::string begin_remedy(const ImportOptions& options, const std::string& verb);

}  // namespace isomesh::import
