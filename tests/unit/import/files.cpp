#include "tests/unit/import/files.h"

#include <iterator>
#include <stdexcept>

namespace isomesh::import::test {

std::filesystem::path Folder::write(std::string_view name, std::string_view bytes) const {
  isomesh::test::write_file(path(name), bytes);
  return path(name);
}

std::size_t Folder::entries() const {
  const std::filesystem::directory_iterator all(folder_.path());
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

Outcome outcome_of(const std::filesystem::path& target,
                   const std::function<Volume(const std::filesystem::path& target)>& import) {
  Outcome outcome;
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

std::vector<std::string> codes_of(const Outcome& outcome) {
  std::vector<std::string> codes;
  for (const Note& note : outcome.volume.notes) codes.push_back(note.code);
  return codes;
}

}  // namespace isomesh::import::test
