#include "tests/fuzz/targets.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "proto/error.h"
#include "proto/json.h"
#include "server/import/dicom/elements/csa_header.h"
#include "server/import/import.h"
#include "server/import/labels/label_table.h"
#include "server/import/labels/label_text.h"
#include "server/import/message/import_message.h"
#include "server/import/readers.h"
#include "server/volume/canonical.h"
#include "server/volume/labels.h"
#include "tests/fuzz/draco_target.h"
#include "tests/support/files.h"
#include "tests/unit/import/archives.h"

namespace isomesh::fuzz {
namespace {

namespace fs = std::filesystem;
using Bytes = std::span<const std::byte>;

std::string_view text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "finding: %s\n", what.c_str());
  std::abort();
}

// A folder of the process, in memory where there is one, emptied between inputs by the imports.
const fs::path& folder() {
  static const test::TemporaryFolder folder(test::fast_place());
  return folder.path();
}

void expect_volume(const Volume& found, const fs::path& canonical) {
  const volume::CanonicalVolume file(canonical);
  if (file.header().dims != found.dims || file.header().type != found.type ||
      file.samples().size() != found.bytes) {
    fail("the volume is not what its canonical file holds");
  }
  if (!volume::is_label_table(found.labels)) fail("the volume's labels are no table");
}

void import_bytes(Bytes bytes, const import::ImportOptions& options) {
  const fs::path source = folder() / "upload";
  test::write_file(source, text_of(bytes));
  const fs::path scratch = folder() / "scratch";
  fs::create_directory(scratch);
  const import::ImportTask task = {.source = source,
                                   .scratch = scratch,
                                   .target = scratch / "canonical",
                                   .options = options,
                                   .limits = {.max_sample_bytes = std::uint64_t{1} << 20}};
  try {
    expect_volume(import::import_volume(task), task.target);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInternal) fail(error.what());
  }
  fs::remove(task.target);
  if (!fs::is_empty(scratch)) fail("an import left files behind");
}

bool is_of(std::string_view format, Bytes bytes) {
  const import::Reader* reader = import::sniff(text_of(bytes).substr(0, import::kSniffBytes));
  return reader != nullptr && reader->name == format;
}

void import_only(std::string_view format, Bytes bytes) {
  if (!is_of(format, bytes)) return;
  import_bytes(bytes, {});
  import_bytes(bytes, {.volume = 1});
}

// For files without a spacing.
void import_spaced(std::string_view format, Bytes bytes) {
  if (!is_of(format, bytes)) return;
  import_bytes(bytes, {.spacing = std::array<double, 3>{1, 1, 1}});
}

void import_archive(const std::vector<import::test::Member>& members) {
  const std::string archive = import::test::tar(members);
  import_bytes(std::as_bytes(std::span(archive)), {.spacing = std::array<double, 3>{1, 1, 1}});
  import_bytes(std::as_bytes(std::span(archive)), {});
}

// Imports a stack of two equal pages.
void import_pages(std::string_view format, Bytes bytes) {
  const std::string page(text_of(bytes));
  if (is_of(format, bytes)) import_archive({{"1", page}, {"2", page}});
}

// A header of text, and samples enough for small sizes.
void import_beside_samples(const std::string& header, const std::string& samples, Bytes bytes) {
  import_archive({{header, std::string(text_of(bytes))}, {samples, std::string(24, 'x')}});
}

// A structure set needs a spacing, unless it is uploaded with images.
void import_structures(Bytes bytes) {
  if (!is_of("dicom", bytes)) return;
  import_bytes(bytes, {.spacing = std::array<double, 3>{1, 1, 2}});
}

void import_anything(Bytes bytes) { import_bytes(bytes, {}); }

// The description comes first, byte for byte, and then the samples.
void import_raw(Bytes bytes) {
  constexpr std::size_t kTypes = 8;
  struct Head {
    std::uint8_t dims[3];
    std::uint8_t type;
    std::uint8_t big_endian;
    double geometry[15];
  } head = {};
  if (bytes.size() < sizeof head) return;
  std::memcpy(&head, bytes.data(), sizeof head);
  RawDescription raw;
  std::copy_n(head.dims, 3, raw.dims.begin());
  raw.type = static_cast<SampleType>(head.type % kTypes);
  raw.big_endian = head.big_endian % 2 != 0;
  std::copy_n(head.geometry, 3, raw.geometry.origin.begin());
  std::copy_n(head.geometry + 3, 3, raw.geometry.spacing.begin());
  std::copy_n(head.geometry + 6, 9, raw.geometry.direction.begin());
  import_bytes(bytes.subspan(sizeof head), {.raw = raw, .series = {}});
}

void open_canonical(Bytes bytes) {
  const fs::path path = folder() / "canonical";
  test::write_file(path, text_of(bytes));
  try {
    const volume::CanonicalVolume file(path);
    if (file.samples().size() != file.header().sample_bytes()) fail("samples of another size");
  } catch (const Error&) {
    return;
  }
}

template <class Read>
void read_text(Bytes bytes, const Read& read) {
  try {
    read(text_of(bytes));
  } catch (const Error&) {
    return;
  }
}

void read_labels(Bytes bytes) {
  read_text(bytes, [](std::string_view text) {
    if (!volume::is_label_table(import::label_table(import::labels_of_text(text)))) {
      fail("the labels of a text are no table");
    }
  });
}

void read_report(Bytes bytes) {
  read_text(bytes, [](std::string_view text) { import::report_from(text); });
  read_text(bytes, [](std::string_view text) { import::order_from(text); });
}

void read_json(Bytes bytes) {
  read_text(bytes, [](std::string_view text) { parse_job_parameters(text); });
  read_text(bytes, [](std::string_view text) { volume_from_json(text); });
  read_text(bytes, [](std::string_view text) { job_from_json(text); });
  read_text(bytes, [](std::string_view text) { problem_from_json(text); });
  read_text(bytes, [](std::string_view text) { volumes_from_json(text); });
  read_text(bytes, [](std::string_view text) { jobs_from_json(text); });
}

const std::vector<Target>& special_targets() {
  static const std::vector<Target> targets = {
      {"upload", import_anything},
      {"numpy", [](Bytes bytes) { import_spaced("numpy", bytes); }},
      {"tiff", [](Bytes bytes) { import_spaced("tiff", bytes); }},
      {"png", [](Bytes bytes) { import_pages("png", bytes); }},
      {"bmp", [](Bytes bytes) { import_pages("bmp", bytes); }},
      {"afni", [](Bytes bytes) { import_beside_samples("a.HEAD", "a.BRIK", bytes); }},
      {"par", [](Bytes bytes) { import_beside_samples("a.PAR", "a.REC", bytes); }},
      {"structures", import_structures},
      {"ascconv",
       [](Bytes bytes) {
         read_text(bytes, [](auto text) { import::dicom::protocol_slices(text); });
       }},
      {"csa",
       [](Bytes bytes) {
         read_text(bytes, [](auto text) { import::dicom::parse_csa_header(text); });
       }},
      {"labels", read_labels},
      {"raw", import_raw},
      {"canonical", open_canonical},
      {"report", read_report},
      {"json", read_json},
      {"draco", encode_mesh},
  };
  return targets;
}

std::vector<Target> all_targets() {
  std::vector<Target> all = special_targets();
  for (const import::Reader* reader : import::readers()) {
    const std::string_view name = reader->name;
    // libhdf5 is known to crash on damaged files.
    if (name == "hdf5" || std::ranges::find(all, name, &Target::name) != all.end()) continue;
    all.push_back({name, [name](Bytes bytes) { import_only(name, bytes); }});
  }
  return all;
}

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all = all_targets();
  return all;
}

const Target& target(std::string_view name) {
  const auto found = std::ranges::find(targets(), name, &Target::name);
  if (found == targets().end()) throw std::out_of_range("no such target");
  return *found;
}

}  // namespace isomesh::fuzz
