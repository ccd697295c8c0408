#include "tests/unit/import/files.h"

#include <iterator>
#include <stdexcept>

namespace isomesh::import::test {
namespace {

// Runs an import that is given a target; keeps what came of it.
template <class Import>
Outcome outcome_of(const Folder& folder, const Import& import) {
  Outcome outcome;
  const std::filesystem::path target = folder.path("target");
  try {
    outcome.volume = import(target);
    outcome.canonical = read_file(target);
  } catch (const Error& error) {
    outcome.code = error.code();
    outcome.error = error.what();
    outcome.remedy = error.remedy();
  }
  return outcome;
}

}  // namespace

std::filesystem::path Folder::write(std::string_view name, std::string_view bytes) const {
  isomesh::test::write_file(path(name), bytes);
  return path(name);
}

std::size_t Folder::entries() const {
  const std::filesystem::directory_iterator all(folder_.path());
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

Outcome import_bytes(std::string_view bytes, const SizeLimits& limits,
                     const ImportOptions& options) {
  const Folder folder;
  const Folder scratch;
  const auto source = folder.write("upload", bytes);
  Outcome outcome = outcome_of(folder, [&](const std::filesystem::path& target) {
    return import_volume({.source = source,
                          .scratch = scratch.path(""),
                          .target = target,
                          .options = options,
                          .limits = limits});
  });
  if (scratch.entries() != 0) throw std::logic_error("an import left files behind");
  return outcome;
}

std::vector<std::string> codes_of(const Outcome& outcome) {
  std::vector<std::string> codes;
  for (const Note& note : outcome.volume.notes) codes.push_back(note.code);
  return codes;
}

Outcome import_raw_bytes(std::string_view bytes, const RawDescription& description,
                         const SizeLimits& limits) {
  const Folder folder;
  const auto source = folder.write("upload", bytes);
  return outcome_of(folder, [&](const std::filesystem::path& target) {
    return import_volume({.source = source,
                          .scratch = folder.path(""),
                          .target = target,
                          .options = {.raw = description, .series = {}},
                          .limits = limits});
  });
}

}  // namespace isomesh::import::test
