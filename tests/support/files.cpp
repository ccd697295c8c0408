#include "tests/support/files.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include <unistd.h>

namespace isomesh::test {

std::filesystem::path fast_place() {
  const std::filesystem::path memory = "/dev/shm";
  return ::access(memory.c_str(), W_OK) == 0 ? memory : std::filesystem::temp_directory_path();
}

TemporaryFolder::TemporaryFolder(const std::filesystem::path& parent) {
  std::string pattern = (parent / "isomesh-test-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

void write_file(const std::filesystem::path& path, std::string_view content) {
  std::ofstream file(path, std::ios::binary);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("cannot read " + path.string());
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> files_below(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  const auto add = [&](const auto& self, std::filesystem::directory_iterator entries) -> void {
    for (const auto& entry : entries) {
      std::error_code gone;  // files and folders may go meanwhile
      if (entry.is_regular_file(gone)) {
        names.push_back(entry.path().lexically_relative(folder).string());
      } else if (entry.is_directory(gone) && !entry.is_symlink(gone)) {
        self(self, std::filesystem::directory_iterator(entry.path(), gone));
      }
    }
  };
  add(add, std::filesystem::directory_iterator(folder));
  std::ranges::sort(names);
  return names;
}

std::vector<std::string> blobs_below(const std::filesystem::path& data) {
  std::vector<std::string> names = files_below(data / "blobs");
  std::erase(names, "identity");
  return names;
}

}  // namespace isomesh::test
