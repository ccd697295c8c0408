#include "tests/unit/import/files.h"

#include <cmath>
#include <cstdlib>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "server/volume/geometry.h"
#include "server/volume/sample_order.h"

namespace isomesh::import::test {

std::filesystem::path Folder::write(std::string_view name, std::string_view bytes) const {
  isomesh::test::write_file(path(name), bytes);
  return path(name);
}

std::size_t Folder::entries() const {
  const std::filesystem::directory_iterator all(folder_.path());
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

namespace {

// The order that undoes the canonical one.
volume::AxisOrder files_order(const std::string& stored_axes) {
  volume::AxisOrder order = {};
  for (std::size_t axis = 0; axis < order.size(); ++axis) {
    const std::size_t same = std::string("LPS").find(stored_axes[axis]);
    const std::size_t opposite = std::string("RAI").find(stored_axes[axis]);
    order[axis] = same < 3 ? static_cast<int>(same) + 1 : -static_cast<int>(opposite) - 1;
  }
  return order;
}

}  // namespace

Outcome in_files_order(Outcome outcome) {
  Volume& volume = outcome.volume;
  const volume::AxisOrder order = files_order(volume.stored_axes.value());
  std::span<std::byte> bytes = std::as_writable_bytes(std::span(outcome.canonical));
  volume::put_in_order(bytes.subspan(kHeaderBytes), bytes_per_sample(volume.type), volume.dims,
                       order);
  volume.geometry = volume::in_order(volume.dims, volume.geometry, order);
  constexpr double kRounding = 1e9;
  for (double& place : volume.geometry.origin)
    place = std::round(place * kRounding) / kRounding + 0;
  volume.dims = volume::in_order(volume.dims, order);
  return outcome;
}

Outcome outcome_of(const std::filesystem::path& target,
                   const std::function<Volume(const std::filesystem::path& target)>& import) {
  Outcome outcome;
  try {
    outcome.volume = import(target);
    outcome.canonical = outcome.stored = read_file(target);
    outcome = in_files_order(std::move(outcome));
  } catch (const Error& error) {
    outcome.code = error.code();
    outcome.error = error.what();
    outcome.remedy = error.remedy();
  }
  return outcome;
}

Outcome import_bytes(std::string_view bytes, const SizeLimits& limits,
                     const ImportOptions& options) {
  const Folder folder;
  const Folder scratch;
  const auto source = folder.write("upload", bytes);
  Outcome outcome = outcome_of(folder.path("target"), [&](const auto& target) {
    return import_volume({.source = source,
                          .scratch = scratch.path(""),
                          .target = target,
                          .options = options,
                          .limits = limits});
  });
  if (scratch.entries() != 0) throw std::logic_error("an import left files behind");
  return outcome;
}

Outcome imported(Outcome outcome) {
  if (!outcome.imported()) throw std::runtime_error(outcome.error);
  return outcome;
}

Outcome without_ends(Outcome outcome, const std::array<double, 3>& first,
                     const std::array<std::uint32_t, 3>& dims) {
  const Volume& volume = outcome.volume;
  std::array<std::size_t, 3> begin = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double along = 0;
    for (std::size_t row = 0; row < 3; ++row) {
      along +=
          (first[row] - volume.geometry.origin[row]) * volume.geometry.direction[row * 3 + axis];
    }
    begin[axis] = static_cast<std::size_t>(std::lround(along / volume.geometry.spacing[axis]));
  }
  const auto is_within = [&](std::size_t axis, std::size_t at) {
    return at >= begin[axis] && at < begin[axis] + dims[axis];
  };
  const std::size_t sample = bytes_per_sample(volume.type);
  std::string kept = outcome.canonical.substr(0, kHeaderBytes);
  std::size_t at = kHeaderBytes;
  for (std::size_t k = 0; k < volume.dims[2]; ++k) {
    for (std::size_t j = 0; j < volume.dims[1]; ++j) {
      for (std::size_t i = 0; i < volume.dims[0]; ++i, at += sample) {
        const std::string bytes = outcome.canonical.substr(at, sample);
        if (is_within(0, i) && is_within(1, j) && is_within(2, k)) {
          kept += bytes;
        } else if (bytes != std::string(sample, '\0')) {
          throw std::runtime_error("a plane that was added is not empty");
        }
      }
    }
  }
  outcome.canonical = std::move(kept);
  outcome.volume.dims = dims;
  outcome.volume.geometry.origin = first;
  return outcome;
}

std::vector<std::string> codes_of(const Outcome& outcome) {
  std::vector<std::string> codes;
  for (const Note& note : outcome.volume.notes) codes.push_back(note.code);
  return codes;
}

}  // namespace isomesh::import::test
