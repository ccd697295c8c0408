#include "client/isomesh/download.h"

#include <algorithm>

#include "base/hex.h"
#include "proto/error.h"

namespace isomesh {

MeshFile file_of(const Job& job, MeshFormat format, std::optional<std::int64_t> label) {
  if (job.state == JobState::kCancelled)
    throw Error(ErrorCode::kCancelled, "the job was cancelled");
  if (job.state == JobState::kFailed) {
    throw job.error ? to_error(*job.error) : Error(ErrorCode::kInternal, "the job failed");
  }
  if (job.state != JobState::kSucceeded || !job.mesh) {
    throw Error(ErrorCode::kNotReady,
                "the job is " + std::string(to_string(job.state)) + "; its mesh is not ready");
  }
  if (const auto found = job.mesh->files.find(format); !label && found != job.mesh->files.end()) {
    return found->second;
  }
  for (const LabelSummary& each : job.mesh->labels) {
    const auto found = each.files.find(format);
    if (found == each.files.end() || (label ? *label != each.label : job.mesh->labels.size() > 1)) {
      continue;
    }
    return {found->second.bytes, found->second.sha256, found->second.href};
  }
  const auto has = [&](const LabelSummary& each) { return each.files.contains(format); };
  if (!label && std::ranges::any_of(job.mesh->labels, has)) {
    throw Error(ErrorCode::kNotFound, "the job has a file of the format \"" +
                                          std::string(to_string(format)) +
                                          "\" for each label; choose a label, or the zip");
  }
  throw Error(ErrorCode::kNotFound, "the job has no file of the format \"" +
                                        std::string(to_string(format)) + '"' +
                                        (label ? " of the label " + std::to_string(*label) : ""));
}

std::vector<std::pair<std::string, std::string>> Download::headers() const {
  if (received_ == 0 || received_ == announced_.bytes) return {};
  return {{"Range", "bytes=" + std::to_string(received_) + "-"},
          {"If-Range", '"' + announced_.sha256 + '"'}};
}

void Download::begin(int status) {
  constexpr int kPartial = 206;
  if (status != kPartial) restart();
}

void Download::restart() {
  if (received_ == 0) return;
  file_.restart();
  sha256_.emplace();
  received_ = 0;
}

void Download::take(std::string_view piece) {
  received_ += piece.size();
  if (received_ > announced_.bytes) refuse();
  file_.write(piece);
  sha256_->update(piece);
  if (progress_) progress_(received_, announced_.bytes);
}

void Download::publish() {
  if (received_ != announced_.bytes || to_hex(sha256_->finish()) != announced_.sha256) refuse();
  file_.publish();
}

void Download::refuse() {
  throw Error(ErrorCode::kDigestMismatch,
              "the received mesh does not match the checksum of the job");
}

}  // namespace isomesh
