#include "client/verify/field.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <string>

#include <stdlib.h>
#include <unistd.h>

#include "base/error.h"
#include "base/files.h"
#include "client/isomesh/package.h"
#include "proto/samples.h"
#include "server/process/child.h"
#include "server/process/fork_server.h"
#include "server/volume/canonical.h"

namespace isomesh::verify {
namespace {

namespace fs = std::filesystem;

class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "isomesh-verify-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw_system_error("mkdtemp", errno);
    path = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  fs::path path;
};

// Beside this program, as in a build, or where it is installed.
fs::path importer() {
  const fs::path own = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& place : {own, own / "../libexec/isomesh"}) {
    if (::access((place / "isomesh-import").c_str(), X_OK) == 0) return place / "isomesh-import";
  }
  throw Error(ErrorCode::kInvalidParameter, "the program isomesh-import was not found");
}

// A folder, or a header with its data, is sent as one file.
fs::path packed(const fs::path& volume, ScratchFile& archive) {
  const std::vector<PackedFile> files = files_of_upload(volume);
  if (files.size() == 1 && files[0].path == volume) return fs::absolute(volume);
  const UploadBody body(volume);
  std::vector<char> block(std::size_t{1} << 20);
  for (std::uint64_t done = 0; done < body.size(); done += block.size()) {
    block.resize(std::min<std::uint64_t>(block.size(), body.size() - done));
    body.read(done, block);
    archive.write(std::as_bytes(std::span(block)));
  }
  return archive.path();
}

}  // namespace

Field read_field(const fs::path& volume, const import::ImportOptions& options) {
  const ScratchFolder scratch;
  ScratchFile archive(scratch.path, ".tar");
  const import::ImportOrder order = {.task = {.source = packed(volume, archive),
                                              .scratch = scratch.path,
                                              .target = scratch.path / "canonical",
                                              .options = options},
                                     .bounds = {}};
  const process::Child server = process::start_program(importer());
  process::Child child = process::copy_of(server, {});
  child.send_last(import::to_message(order));
  constexpr std::size_t kMostMessages = std::size_t{64} << 20;
  const auto deadline = std::chrono::steady_clock::now() + order.bounds.time;
  const import::ImportReport report =
      import::report_from(child.receive(kMostMessages, deadline, {}).text);
  child.end();
  if (report.error) throw *report.error;
  if (!report.volume) throw Error(ErrorCode::kUnusableVolume, "reading the volume failed");

  const volume::CanonicalVolume canonical(order.task.target);
  const volume::CanonicalHeader& header = canonical.header();
  Field field;
  field.dims = {header.dims[0], header.dims[1], header.dims[2]};
  field.origin = header.geometry.origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      field.steps[axis][row] =
          header.geometry.direction[3 * row + axis] * header.geometry.spacing[axis];
    }
  }
  with_sample(header.type, [&](auto sample) {
    using Sample = decltype(sample);
    const auto* first = reinterpret_cast<const Sample*>(canonical.samples().data());
    field.samples.assign(first, first + canonical.samples().size() / sizeof(Sample));
  });
  return field;
}

Vec Field::index_of(const Vec& place) const {
  const Vec from = place - origin;
  const double volume = dot(steps[0], cross(steps[1], steps[2]));
  return {dot(from, cross(steps[1], steps[2])) / volume,
          dot(from, cross(steps[2], steps[0])) / volume,
          dot(from, cross(steps[0], steps[1])) / volume};
}

void Field::crop(const std::array<Vec, 2>& box) {
  constexpr double kTolerance = 1e-6;
  std::array<std::int64_t, 3> begin = dims;
  std::array<std::int64_t, 3> end = {0, 0, 0};
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Vec index =
        index_of({box[corner & 1][0], box[corner >> 1 & 1][1], box[corner >> 2 & 1][2]});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double last = static_cast<double>(dims[axis] - 1);
      const double x = std::clamp(index[axis], -1.0, last + 1);
      begin[axis] = std::min(begin[axis],
                             static_cast<std::int64_t>(std::ceil(std::max(x - kTolerance, 0.0))));
      end[axis] = std::max(
          end[axis], static_cast<std::int64_t>(std::floor(std::min(x + kTolerance, last))) + 1);
    }
  }
  std::vector<double> kept;
  for (std::int64_t k = begin[2]; k < end[2]; ++k) {
    for (std::int64_t j = begin[1]; j < end[1]; ++j) {
      const auto row = samples.begin() + (k * dims[1] + j) * dims[0];
      if (begin[0] < end[0]) kept.insert(kept.end(), row + begin[0], row + end[0]);
    }
  }
  if (kept.empty()) throw invalid_parameter("crop", "the box has no samples of the volume");
  samples = std::move(kept);
  origin = place({static_cast<double>(begin[0]), static_cast<double>(begin[1]),
                  static_cast<double>(begin[2])});
  for (std::size_t axis = 0; axis < 3; ++axis) dims[axis] = end[axis] - begin[axis];
}

}  // namespace isomesh::verify
