#include "server/hospital/association/sink.h"

#include <cstddef>
#include <span>

#include <fcntl.h>

#include "base/error.h"

namespace isomesh::association {

FileSink::FileSink(const std::filesystem::path& path, std::uint64_t most_bytes)
    : file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)),
      room_(most_bytes),
      has_failed_(file_.number() < 0) {}

offile_off_t FileSink::write(const void* bytes, offile_off_t count) {
  const auto size = static_cast<std::size_t>(count);
  if (has_failed_) return count;
  if (size > room_) {
    has_failed_ = true;
    return count;
  }
  try {
    write_all(file_, std::span(static_cast<const std::byte*>(bytes), size));
    room_ -= size;
  } catch (const Error&) {
    has_failed_ = true;
  }
  return count;
}

}  // namespace isomesh::association
