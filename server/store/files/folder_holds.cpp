#include "server/store/files/folder_holds.h"

#include <system_error>

#include "base/error.h"
#include "base/ids.h"
#include "server/store/files/files.h"

namespace isomesh::store {

// The name is the blob's key, a dot and random digits.
std::string FolderHolds::hold(const std::string& key) const {
  std::string name = key + '.' + random_hex(8);
  File::create(folder_ / name);
  return name;
}

void FolderHolds::let_go(const std::string& name) const {
  std::error_code ignored;  // a leftover hold expires
  std::filesystem::remove(folder_ / name, ignored);
}

std::set<std::string> FolderHolds::held(std::chrono::nanoseconds oldest) const {
  std::set<std::string> keys;
  const auto now = this->now();
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

void FolderHolds::forget(std::chrono::nanoseconds oldest) const {
  const auto now = this->now();
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, gone)) {
    const auto made = entry.last_write_time(gone);
    if (!gone && now - made > oldest) std::filesystem::remove(entry.path(), gone);
  }
}

std::filesystem::file_time_type FolderHolds::now() const {
  const std::string name = hold("now");
  std::error_code error;
  const auto time = std::filesystem::last_write_time(folder_ / name, error);
  let_go(name);
  if (error) throw_system_error("reading a file's time", error.value());
  return time;
}

}  // namespace isomesh::store
