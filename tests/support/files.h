#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::test {

// A place where files that only one process needs are fast: in memory, if the machine has one.
std::filesystem::path fast_place();

// A new, empty folder; the destructor removes it with its content.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(
      const std::filesystem::path& parent = std::filesystem::temp_directory_path());
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// Throw std::runtime_error with the file's name.
void write_file(const std::filesystem::path& path, std::string_view content);
std::string read_file(const std::filesystem::path& path);

// All regular files below a folder, as sorted paths relative to it.
std::vector<std::string> files_below(const std::filesystem::path& folder);

// The same for the blobs of a data folder.
std::vector<std::string> blobs_below(const std::filesystem::path& data);

// Converts arrays to bytes, and back to text.
template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
inline std::span<const std::byte> as_span(std::string_view text) {
  return std::as_bytes(std::span(text));
}

}  // namespace isomesh::test
