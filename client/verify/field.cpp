#include "client/verify/field.h"

#include <algorithm>
#include <chrono>
#include <string>

#include <stdlib.h>
#include <unistd.h>

#include "base/error.h"
#include "base/files.h"
#include "client/isomesh/package.h"
#include "proto/samples.h"
#include "server/process/fork_server.h"
#include "server/volume/canonical.h"

namespace isomesh::verify {
namespace {

namespace fs = std::filesystem;

struct Folder {
  fs::path path;
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

// Beside this program, as in a build, or where it is installed.
fs::path importer() {
  const fs::path own = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& place : {own, own / "../libexec/isomesh"}) {
    if (::access((place / "isomesh-import").c_str(), X_OK) == 0) return place / "isomesh-import";
  }
  throw Error(ErrorCode::kInvalidParameter, "the program isomesh-import was not found");
}

}  // namespace

Field read_field(const fs::path& volume, const import::ImportOptions& options) {
  std::string name = fs::temp_directory_path() / "isomesh-verify-XXXXXX";
  if (::mkdtemp(name.data()) == nullptr) throw_system_error("mkdtemp", errno);
  const Folder scratch = {name};
  // A folder, or a header with its data, becomes one file.
  const UploadBody body(volume);
  ScratchFile upload(name, "");
  std::vector<char> block(std::size_t{1} << 20);
  for (std::uint64_t done = 0; done < body.size(); done += block.size()) {
    block.resize(std::min<std::uint64_t>(block.size(), body.size() - done));
    body.read(done, block);
    upload.write(std::as_bytes(std::span(block)));
  }
  const fs::path target = scratch.path / "canonical";
  const import::ImportOrder order = {{upload.path(), name, target, options, {}}, {}};
  const process::Child server = process::start_program(importer());
  process::Child child = process::copy_of(server, {});
  child.send_last(import::to_message(order));
  const auto deadline = std::chrono::steady_clock::now() + order.bounds.time;
  constexpr std::size_t kMostBytes = std::size_t{64} << 20;
  const auto report = import::report_from(child.receive(kMostBytes, deadline, {}).text);
  child.end();
  if (report.error) throw *report.error;
  if (!report.volume) throw Error(ErrorCode::kUnusableVolume, "reading the volume failed");

  const volume::CanonicalVolume canonical(target);
  const auto& [dims, type, geometry] = canonical.header();
  Field field = {{dims[0], dims[1], dims[2]}, {}, geometry.origin, {}};
  for (std::size_t n = 0; n < 9; ++n) {
    field.steps[n % 3][n / 3] = geometry.direction[n] * geometry.spacing[n % 3];
  }
  const std::span<const std::byte> bytes = canonical.samples();
  with_sample(type, [&](auto sample) {
    const auto* first = reinterpret_cast<const decltype(sample)*>(bytes.data());
    field.values.assign(first, first + bytes.size() / sizeof sample);
  });
  return field;
}

Vec Field::index_of(const Vec& place) const {
  const Vec from = place - origin;
  const auto& [x, y, z] = steps;
  return 1 / dot(x, cross(y, z)) *
         Vec{dot(from, cross(y, z)), dot(from, cross(z, x)), dot(from, cross(x, y))};
}

Field Field::part(const Sample& begin, const Sample& end) const {
  Field part = {{end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]}, {}, {}, steps};
  part.origin = place({static_cast<double>(begin[0]), static_cast<double>(begin[1]),
                       static_cast<double>(begin[2])});
  const auto is_in = [&](std::int64_t x, std::size_t axis) { return x >= 0 && x < dims[axis]; };
  for (std::int64_t k = begin[2]; k < end[2]; ++k) {
    for (std::int64_t j = begin[1]; j < end[1]; ++j) {
      for (std::int64_t i = begin[0]; i < end[0]; ++i) {
        const auto at = static_cast<std::size_t>((k * dims[1] + j) * dims[0] + i);
        const bool is_here = is_in(i, 0) && is_in(j, 1) && is_in(k, 2);
        part.values.push_back(is_here ? values[at] : -std::numeric_limits<double>::infinity());
      }
    }
  }
  return part;
}

Field Field::cropped(const std::array<Vec, 2>& box) const {
  constexpr double kTolerance = 1e-6;  // of a step: a sample on a face is in the box
  Sample begin = dims;
  Sample end = {0, 0, 0};
  for (unsigned c = 0; c < 8; ++c) {
    const Vec index = index_of({box[c & 1][0], box[c >> 1 & 1][1], box[c >> 2][2]});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = std::clamp(index[axis], -1.0, static_cast<double>(dims[axis]));
      begin[axis] = std::min(begin[axis], static_cast<std::int64_t>(std::ceil(x - kTolerance)));
      end[axis] = std::max(end[axis], static_cast<std::int64_t>(std::floor(x + kTolerance)) + 1);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    begin[axis] = std::max<std::int64_t>(begin[axis], 0);
    end[axis] = std::min(end[axis], dims[axis]);
    if (end[axis] <= begin[axis]) throw invalid_parameter("crop", "the box has no samples");
  }
  return part(begin, end);
}

}  // namespace isomesh::verify
