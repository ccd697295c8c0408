// Downloads a mesh to a file.
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

// The file of a finished job in that format; with `label`, one label's own file of a job by labels.
// Throws as Client::fetch does if there is none.
MeshFile file_of(const Job& job, MeshFormat format, std::optional<std::int64_t> label);

// Writes a mesh as it arrives and checks it against the job's size and digest. Not thread safe.
class Download {
 public:
  Download(MeshFile announced, const std::filesystem::path& target,
           const TransferProgress& progress)
      : announced_(std::move(announced)), file_(target), progress_(progress) {}

  // The request headers to resume a download; none if nothing has arrived.
  std::vector<std::pair<std::string, std::string>> headers() const;

  // Takes the status of the response: the whole file, or the requested range.
  void begin(int status);

  // Throws Error kDigestMismatch for too many bytes.
  void take(std::string_view piece);

  // Throws Error kDigestMismatch for wrong bytes.
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
