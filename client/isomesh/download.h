// A mesh on its way from the server to a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/sha256.h"
#include "client/isomesh/client.h"
#include "client/isomesh/file.h"
#include "proto/types.h"

namespace isomesh {

// The file of a finished job in that format; of a job by labels, with `label`, one label's own.
// Throws as Client::fetch does where there is none.
MeshFile file_of(const Job& job, MeshFormat format, std::optional<std::int64_t> label);

// Writes a mesh as it arrives and compares it with the size and digest that the job announced. Not
// thread safe.
class Download {
 public:
  Download(MeshFile announced, const std::filesystem::path& target,
           const TransferProgress& progress)
      : announced_(std::move(announced)), file_(target), progress_(progress) {}

  // What to ask for to go on where a connection broke; all of it where nothing has come yet.
  std::vector<std::pair<std::string, std::string>> headers() const;

  // The status of the answer that comes: of all bytes, or of those that were asked for.
  void begin(int status);

  // Throws Error kDigestMismatch for more bytes than were announced.
  void take(std::string_view piece);

  // Throws Error kDigestMismatch when other bytes came.
  void publish();

 private:
  [[noreturn]] static void refuse();
  void restart();

  const MeshFile announced_;
  PartFile file_;
  const TransferProgress& progress_;
  std::optional<Sha256> sha256_{std::in_place};
  std::uint64_t received_ = 0;
};

}  // namespace isomesh
