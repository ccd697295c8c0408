// What a header says about a volume: all but the samples themselves.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/import/source/gzip.h"
#include "server/import/source/names.h"
#include "server/import/source/stored_samples.h"

namespace isomesh::import {

// How many bytes of a file decide how long it may be, and how many it can have by what they tell.
inline constexpr std::size_t kBeginningBytes = std::size_t{1} << 20;
struct MostBytes {
  std::uint64_t file = 0;
  std::uint64_t data = 0;  // each of the data files that its header names
};

enum class Encoding {
  kRaw,
  kDeflate,  // a gzip or zlib stream
  kBzip2,
  kText,  // numbers between white space
  kHex,   // pairs of hexadecimal digits, white space between them ignored
  kVtk,   // see VtkEncoding
};

// How VTK encodes an array: a header of counts comes first, then its bytes, which may be compressed
// by zlib in blocks; all of it may be in base64.
// By which of VTK's compressors.
enum class VtkCompression { kNone, kZlib, kLz4, kXz };

struct VtkEncoding {
  bool base64 = false;
  VtkCompression compression = VtkCompression::kNone;
  bool wide_header = false;  // counts of 8 bytes instead of 4
  bool big_endian = false;
};

// What came with a file in the same archive.
struct Companions {
  std::string name;  // of the file itself, without folders; empty for one that came alone
  // The other files of its folder and of the folders in that, by their paths from there.
  std::map<std::string, std::filesystem::path, std::less<>> files;
};

// The companion that a header names, "./" before it or not. Throws Error kUnusableVolume where it
// did not come, and for a path that leads out of the header's folder.
const std::filesystem::path& companion(const std::string& name, const Companions& companions);

// A file that holds samples and no header.
struct DataFile {
  std::filesystem::path path;
  CompressedRange range;
};

// Which of a file's volumes is read. They lie one behind the other, or sample by sample.
struct VolumeOfFile {
  std::uint64_t index = 0;
  std::uint64_t count = 1;
  bool is_interleaved = false;
};

// Where the samples begin in what their encoding holds: so many bytes behind its beginning, or, if
// empty, where they end with it.
using Skip = std::optional<std::uint64_t>;

// A segmentation whose segments lie in several layers, so that they may overlap. A layer is one of
// the file's volumes.
struct SegmentLayers {
  bool is_interleaved = false;
  // The label of a segment, by its layer and its value there. 0 is no segment's.
  std::map<std::pair<std::uint64_t, std::int64_t>, std::uint32_t> labels;
};

struct SourceVolume {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  VolumeOfFile chosen;
  SampleLayout layout;
  Encoding encoding = Encoding::kRaw;
  Skip decoded_skip = 0;    // of encoded samples
  CompressedRange payload;  // where the samples lie, unless there are data files
  VtkEncoding vtk;          // for Encoding::kVtk
  // Of a header without samples: the files that hold equal parts of them, in this order.
  std::vector<DataFile> data_files;
  Geometry geometry;
  std::vector<Note> notes;
  std::vector<LabelEntry> labels;       // as label_table() has them
  std::optional<SegmentLayers> layers;  // all volumes are read then, and `chosen` is the first

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  // What the samples of one volume and of all volumes take up in the file, once decoded.
  std::uint64_t volume_bytes() const { return sample_count() * bytes_per_sample(layout.type); }
  std::uint64_t stored_bytes() const { return volume_bytes() * chosen.count; }
  // What they take up at most as they are encoded, with generous white space.
  std::uint64_t most_encoded_bytes() const;
};

// Throws Error kTooLarge when the volume's canonical samples would exceed the limits.
void check_limits(const SourceVolume& volume, const SizeLimits& limits);

// The data files that a header names, in its order. Each holds the same share of `volume`'s
// samples, behind `skip` of it. A single file may be longer by less than a slice, which is noted in
// `volume`. Throws Error kUnusableVolume for a name that is none of a companion, for a file of
// another size than its share and the skip, and where the samples' place cannot be known.
std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const Skip& skip,
                                    SourceVolume& volume);

// Whether that many bytes more than the header tells may be left out: some programs fill their last
// block up. A whole slice more means that the header describes another volume.
bool may_trail(std::uint64_t bytes, const SourceVolume& volume);
Note trailing_note(std::uint64_t bytes);

// Of so many files that came a second time, and why one of them is ignored.
Note duplicate_note(std::size_t files);
std::string reason_of_double(std::string_view first_name);

// How the volumes of one file differ.
struct Difference {
  std::string what;                                       // such as "time"
  std::function<std::string(std::uint64_t index)> title;  // of one volume, such as "6 s"
};

// How many volumes a file holds of which a header tells these sizes. Throws Error kUnusableVolume
// for numbers that are not believable.
std::uint64_t volumes_beyond(std::span<const std::uint64_t> sizes);

// Sets which of `count` volumes is read, with a note where there are several. Throws Error
// kUnusableVolume with the choices where the options leave it open or choose one that is not there.
void choose_volume(std::uint64_t count, const Difference& difference, const ImportOptions& options,
                   SourceVolume& volume);

}  // namespace isomesh::import
