// What the daemon and the process that imports for it say to each other over a pipe: one task, and
// back lines of JSON, the last of which holds the volume or why there is none.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/error.h"
#include "server/volume/import.h"

namespace isomesh::volume {

// What the process may take.
struct ImportBounds {
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  // beside the samples, which are mapped
  std::chrono::seconds time = std::chrono::minutes(10);
};

struct ImportOrder {
  ImportTask task;
  ImportBounds bounds;
};

std::string to_message(const ImportOrder& order);
// Throws Error kInternal when it is none.
ImportOrder order_from(std::string_view message);

// Each is a line with its end.
std::string reading_message(std::string_view format);
std::string volume_message(const Volume& volume);
std::string error_message(const Error& error);

// What an importing process has said so far.
struct ImportReport {
  std::string reading;  // the last format that it named; printable
  std::optional<Volume> volume;
  std::optional<Error> error;
};

// Reads whole lines and passes over a last one that was cut. Throws Error kInternal when the lines
// are not what our process says.
ImportReport report_from(std::string_view messages);

}  // namespace isomesh::volume
