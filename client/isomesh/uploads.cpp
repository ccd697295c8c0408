// Uploads. Large ones are resumed: "Resumable Uploads for HTTP"
// (draft-ietf-httpbis-resumable-upload); docs/uploads.md has the server's subset.
#include <algorithm>
#include <array>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/base64.h"
#include "base/sha256.h"
#include "base/text.h"
#include "client/isomesh/impl.h"
#include "client/isomesh/package.h"
#include "proto/json.h"

namespace isomesh {
namespace {

constexpr std::size_t kDigestBytes = 1024 * 1024;

template <std::size_t N>
std::string joined(const std::array<double, N>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ",") + to_text(value);
  return text;
}

void add_raw(const RawDescription& raw, Query& pairs) {
  const auto& [x, y, z] = raw.dims;
  pairs.emplace_back("dims", std::to_string(x) + "," + std::to_string(y) + "," + std::to_string(z));
  pairs.emplace_back("type", to_string(raw.type));
  pairs.emplace_back("spacing", joined(raw.geometry.spacing));
  pairs.emplace_back("origin", joined(raw.geometry.origin));
  pairs.emplace_back("direction", joined(raw.geometry.direction));
  if (raw.big_endian) pairs.emplace_back("byte_order", "big");
}

std::string upload_query(const UploadOptions& options) {
  Query pairs;
  if (options.raw) {
    RawDescription raw = *options.raw;
    if (options.spacing) raw.geometry.spacing = *options.spacing;
    add_raw(raw, pairs);
  }
  if (!options.series.empty()) pairs.emplace_back("series", options.series);
  if (!options.member.empty()) pairs.emplace_back("member", options.member);
  if (options.masks) pairs.emplace_back("masks", "true");
  if (options.volume) pairs.emplace_back("volume", std::to_string(*options.volume));
  std::string accepted;
  for (const std::string& code : options.accept) accepted += (accepted.empty() ? "" : ",") + code;
  if (!accepted.empty()) pairs.emplace_back("accept", accepted);
  if (options.nifti_form) pairs.emplace_back("nifti_form", to_string(*options.nifti_form));
  if (options.modality) pairs.emplace_back("modality", to_string(*options.modality));
  if (options.spacing && !options.raw) pairs.emplace_back("spacing", joined(*options.spacing));
  return pairs.empty() ? std::string() : query_string(pairs);
}

// File names may name patients, so they are sent in a header: logs contain targets.
std::string disposition_of(const std::filesystem::path& path, const std::string& name) {
  const auto file = (path.has_filename() ? path : path.parent_path()).filename();
  return name.empty() ? "attachment; filename*=UTF-8''" + percent_encode(file.string())
                      : "attachment; name*=UTF-8''" + percent_encode(name);
}

std::string digest_of(const UploadBody& file) {
  Sha256 sha256;
  std::vector<char> piece(kDigestBytes);
  for (std::uint64_t offset = 0; offset < file.size(); offset += piece.size()) {
    piece.resize(
        static_cast<std::size_t>(std::min<std::uint64_t>(kDigestBytes, file.size() - offset)));
    file.read(offset, piece);
    sha256.update(std::string_view(piece.data(), piece.size()));
  }
  return to_base64(sha256.finish());
}

constexpr const char* kPlaces = "/v1/uploads/";

// The digest of the whole body is sent with its beginning, which is empty.
HttpRequest beginning_of(const HttpRequest& upload) {
  HttpRequest request{.method = upload.method, .target = upload.target};
  for (const auto& [name, value] : upload.headers) {
    request.headers.emplace_back(name == "Content-Digest" ? "Repr-Digest" : name, value);
  }
  request.headers.emplace_back("Upload-Complete", "?0");
  request.headers.emplace_back("Upload-Length", std::to_string(upload.source_bytes));
  return request;
}

HttpRequest rest_of(const HttpRequest& upload, const std::string& place, std::uint64_t offset) {
  HttpRequest request{.method = "PATCH", .target = place};
  request.headers = {{"Content-Type", "application/partial-upload"},
                     {"Upload-Complete", "?1"},
                     {"Upload-Offset", std::to_string(offset)}};
  request.source = [&upload, offset](std::uint64_t at, std::span<char> piece) {
    upload.source(offset + at, piece);
  };
  request.source_bytes = upload.source_bytes - offset;
  return request;
}

// Asks for the result of a complete upload.
HttpRequest reading_of(const HttpRequest& upload, const std::string& place) {
  const char* sign = upload.target.find('?') == std::string::npos ? "?" : "&";
  return {.method = upload.method,
          .target = upload.target + sign + "upload=" + place.substr(place.rfind('/') + 1),
          .headers = {{"Content-Type", "application/octet-stream"}}};
}

// True if a retry may help: a proxy does not reach the server, or it still has the broken
// connection. While the server is busy, the transport waits.
bool may_pass(int status) {
  constexpr std::array kPassing = {408, 409, 502, 504};
  return std::ranges::count(kPassing, status) > 0;
}

// True if somebody else has cancelled the upload.
bool is_cancelled(const HttpResponse& response) {
  return response.status == 409 && refusal(response).code() == ErrorCode::kCancelled;
}

// The volumes that were stored before the upload was cancelled.
std::string told_volumes(const std::vector<Volume>& volumes) {
  std::string ids;
  for (const Volume& volume : volumes) ids += (ids.empty() ? "" : ", ") + volume.id;
  if (ids.empty()) return {};
  return std::string("; it was too late to cancel ") +
         (volumes.size() == 1 ? "the volume " : "the volumes ") + ids;
}

struct Progress {
  std::uint64_t offset = 0;
  bool is_whole = false;
};

Progress progress_of(const HttpResponse& response, std::uint64_t bytes) {
  const auto offset = parse_uint64(response.header("upload-offset"));
  if (!offset || *offset > bytes) throw other_api();
  return {*offset, response.header("upload-complete") == "?1"};
}

// Each has a volume or a problem.
std::vector<UploadedVolume> checked(std::vector<UploadedVolume> volumes) {
  const auto is_one = [](const UploadedVolume& each) {
    return each.volume.has_value() != each.problem.has_value();
  };
  if (volumes.empty() || !std::ranges::all_of(volumes, is_one)) throw other_api();
  if (volumes.size() == 1 && volumes.front().problem) throw to_error(*volumes.front().problem);
  return volumes;
}

}  // namespace

Error several_volumes(const std::vector<UploadedVolume>& volumes) {
  Remedy remedy;
  for (const UploadedVolume& each : volumes) {
    remedy.choices.push_back(
        {"member", each.member, each.problem ? each.problem->detail : "can be meshed"});
  }
  return Error(ErrorCode::kUnusableVolume, "the upload contains " + std::to_string(volumes.size()) +
                                               " volumes, but one is needed")
      .with_remedy(std::move(remedy));
}

Volume Client::upload(const std::filesystem::path& path, const UploadOptions& options) {
  std::vector<UploadedVolume> volumes = upload_all({path}, options);
  if (volumes.size() == 1 && volumes.front().volume) return std::move(*volumes.front().volume);
  throw several_volumes(volumes);
}

std::vector<UploadedVolume> Client::upload_all(const std::vector<std::filesystem::path>& paths,
                                               const UploadOptions& options) {
  const UploadBody file(paths);
  HttpRequest request{.method = "POST", .target = "/v1/volumes" + upload_query(options)};
  request.headers = {{"Content-Type", "application/octet-stream"},
                     {"Content-Disposition", disposition_of(paths.front(), options.name)}};
  if (options.digest) {
    request.headers.emplace_back("Content-Digest", "sha-256=:" + digest_of(file) + ":");
  }
  request.source_bytes = file.size();
  request.source = [&](std::uint64_t offset, std::span<char> piece) {
    if (options.progress) options.progress(offset, file.size());
    file.read(offset, piece);
    if (options.progress && offset + piece.size() == file.size()) {
      options.progress(file.size(), file.size());
    }
  };
  constexpr int kMultiStatus = 207;
  const bool is_resumable = file.size() >= options.resumable_bytes;
  const HttpResponse response = is_resumable ? impl_->resumed(request) : impl_->exchange(request);
  if (response.status == kMultiStatus) return checked(uploaded_volumes_from_json(response.body));
  return {{.member = {}, .status = response.status, .volume = volume_from_json(response.body)}};
}

std::string Client::Impl::begin_upload(const HttpRequest& request) const {
  std::string place = repeated(beginning_of(request)).header("location");
  // A proxy may have made it absolute.
  if (const std::size_t scheme = place.find("://"); scheme != std::string::npos) {
    place.erase(0, place.find('/', scheme + 3));
  }
  if (!place.starts_with(kPlaces)) throw other_api();
  return place;
}

HttpResponse Client::Impl::resumed(const HttpRequest& request) const {
  const std::string place = begin_upload(request);
  try {
    return finish_upload(request, place);
  } catch (const NoResponse&) {
    throw;  // cannot be reported to the server
  } catch (const Error& error) {
    // It has expired, or another daemon answered.
    if (error.code() == ErrorCode::kGone) return exchange(request);
    const std::string left = give_up(place);
    if (left.empty()) throw;
    throw error.with_detail(error.what() + left);
  } catch (...) {
    give_up(place);
    throw;
  }
}

// Cancels the upload, and returns what the user should know about its volumes.
std::string Client::Impl::give_up(const std::string& place) const {
  try {
    const HttpResponse response = parting_.send({.method = "DELETE", .target = place});
    return response.status == 200 ? told_volumes(volumes_from_json(response.body)) : std::string();
  } catch (const Error&) {
    // An incomplete upload expires on the server.
    return "; the server did not confirm that the upload was cancelled";
  }
}

HttpResponse Client::Impl::finish_upload(const HttpRequest& request,
                                         const std::string& place) const {
  std::optional<Progress> known = Progress();
  Patience patience;
  std::exception_ptr failure;
  const auto excuse = [&](std::chrono::milliseconds busy) { patience.excuse(busy); };
  const auto fail = [&](const std::exception_ptr& why) {
    failure = why;
    patience.fail();
    if (!known && patience.is_over()) std::rethrow_exception(why);
    known.reset();
    pause(patience.next_pause());
  };
  while (true) {
    if (known && patience.is_over()) std::rethrow_exception(failure);
    try {
      HttpResponse response =
          transport_.send(!known            ? HttpRequest{.method = "HEAD", .target = place}
                          : known->is_whole ? reading_of(request, place)
                                            : rest_of(request, place, known->offset),
                          excuse);
      // The reason of a conflict is in the body of a GET.
      if (!known && response.status == 409) response = transport_.send({.target = place}, excuse);
      if (is_success(response)) {
        if (known) return response;
        known = progress_of(response, request.source_bytes);
        patience.hear(known->offset);
      } else if (!may_pass(response.status) || is_cancelled(response)) {
        throw refusal(response);
      } else {
        fail(std::make_exception_ptr(refusal(response)));
      }
    } catch (const NoResponse&) {
      fail(std::current_exception());
    }
  }
}

}  // namespace isomesh
