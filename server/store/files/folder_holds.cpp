#include "server/store/files/folder_holds.h"

#include <system_error>

#include "base/error.h"
#include "base/ids.h"
#include "server/store/file.h"

namespace isomesh::store {
namespace {

std::string make_file(const std::filesystem::path& folder, const std::string& key) {
  std::string name = key + '.' + random_hex(8);
  File::create(folder / name);
  return name;
}

void remove_file(const std::filesystem::path& file) {
  std::error_code ignored;  // a leftover hold expires
  std::filesystem::remove(file, ignored);
}

// The current time by the clock of the folder.
std::filesystem::file_time_type time_in(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / make_file(folder, "now");
  std::error_code error;
  const auto time = std::filesystem::last_write_time(file, error);
  remove_file(file);
  if (error) throw_system_error("reading a file's time", error.value());
  return time;
}

}  // namespace

// The name is the blob's key, a dot and random digits.
std::string FolderHolds::hold(const std::string& key) { return make_file(folder_, key); }

void FolderHolds::let_go(const std::string& name) { remove_file(folder_ / name); }

std::set<std::string> FolderHolds::held(std::chrono::nanoseconds oldest) const {
  std::set<std::string> keys;
  const auto now = time_in(folder_);
  std::error_code error;
  std::filesystem::directory_iterator entry(folder_, error);
  if (error) throw_system_error("reading the folder of holds", error.value());
  for (; entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    std::error_code gone;  // removed meanwhile
    const auto made = entry->last_write_time(gone);
    if (gone || now - made > oldest) continue;
    const std::string name = entry->path().filename();
    keys.insert(name.substr(0, name.find('.')));
  }
  if (error) throw_system_error("reading the folder of holds", error.value());
  return keys;
}

void FolderHolds::forget(std::chrono::nanoseconds oldest) {
  const auto now = time_in(folder_);
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, gone)) {
    const auto made = entry.last_write_time(gone);
    if (!gone && now - made > oldest) std::filesystem::remove(entry.path(), gone);
  }
}

}  // namespace isomesh::store
