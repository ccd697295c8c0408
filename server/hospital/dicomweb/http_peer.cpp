#include "server/hospital/dicomweb/http_peer.h"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fcntl.h>

#include "base/curl.h"
#include "base/curl_transfer.h"
#include "base/descriptor.h"
#include "base/files.h"
#include "base/text.h"

namespace isomesh::dicomweb {
namespace {

using orders::PacsFailure;
using orders::PacsFault;

// Reads a secret of one line.
std::string secret_in(const std::filesystem::path& file) {
  std::string secret;
  try {
    const std::string text = read_whole(file);
    secret = trimmed(text);
  } catch (const Error&) {
  }
  if (secret.empty() || has_control_characters(secret)) {
    throw PacsFailure(PacsFault::kUnauthorized,
                      "the password file or token file of the PACS cannot be used");
  }
  return secret;
}

// The encodings that libcurl decodes on Debian.
bool is_decoded(std::string_view encoding) {
  constexpr std::array<std::string_view, 5> kKnown = {"gzip", "x-gzip", "deflate", "br", "zstd"};
  return std::ranges::find(kKnown, encoding) != kKnown.end();
}

class Exchange {
 public:
  Exchange(const orders::PacsSettings& settings, const PeerRequest& request, std::stop_token stop)
      : request_(request),
        stop_(std::move(stop)),
        target_(
            ::open(request.response_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)),
        easy_(curl::make_easy()) {
    if (target_.number() < 0) throw_system_error("open", errno);
    set_connection(settings);
    set_request();
  }

  PeerResponseHead perform() {
    const CURLcode result = curl::Transfer(easy_.get(), callbacks(), stop_).perform();
    if (result != CURLE_OK) throw_failure(result);
    PeerResponseHead head;
    head.has_more_results = has_more_results_;
    long status = 0;
    curl_easy_getinfo(easy_.get(), CURLINFO_RESPONSE_CODE, &status);
    head.status = static_cast<int>(status);
    const char* type = nullptr;
    curl_easy_getinfo(easy_.get(), CURLINFO_CONTENT_TYPE, &type);
    constexpr std::size_t kLongestType = 1024;
    if (type != nullptr)
      head.content_type = printable(std::string_view(type).substr(0, kLongestType));
    curl_off_t retry_after = 0;
    curl_easy_getinfo(easy_.get(), CURLINFO_RETRY_AFTER, &retry_after);
    head.retry_after = std::chrono::seconds(retry_after);
    return head;
  }

 private:
  void set_connection(const orders::PacsSettings& settings) {
    CURL* easy = easy_.get();
    curl_easy_setopt(easy, CURLOPT_URL, (settings.dicomweb + request_.target).c_str());
    curl::connect_directly(easy, settings.ca_file);
    const auto timeout = static_cast<long>(settings.timeout.count());
    curl_easy_setopt(easy, CURLOPT_CONNECTTIMEOUT, timeout);
    // A slow PACS is not an error; only one without progress is given up. A PACS sends nothing
    // while it stores an object, so larger objects get more time.
    constexpr std::uint64_t kStoredPerSecond = std::uint64_t{4} << 20;
    const std::uint64_t sent = request_.body == nullptr ? 0 : request_.body->bytes;
    curl_easy_setopt(easy, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(easy, CURLOPT_LOW_SPEED_TIME,
                     timeout + static_cast<long>(sent / kStoredPerSecond));
    if (request_.most_time) {
      curl_easy_setopt(easy, CURLOPT_TIMEOUT_MS, static_cast<long>(request_.most_time->count()));
    }
    curl_easy_setopt(easy, CURLOPT_USERAGENT, "isomesh/" ISOMESH_VERSION);
    if (!settings.user.empty()) {
      curl_easy_setopt(easy, CURLOPT_HTTPAUTH, static_cast<long>(CURLAUTH_BASIC));
      curl_easy_setopt(easy, CURLOPT_USERNAME, settings.user.c_str());
      curl_easy_setopt(easy, CURLOPT_PASSWORD, secret_in(settings.password_file).c_str());
    }
    if (!settings.token_file.empty()) {
      curl::append(headers_, "Authorization: Bearer " + secret_in(settings.token_file));
    }
  }

  void set_request() {
    CURL* easy = easy_.get();
    curl::append(headers_, "Accept: " + request_.accept);
    // Samples hardly shrink, so compression is not requested. Some PACS compress nevertheless; with
    // this option, libcurl decompresses.
    curl::append(headers_, "Accept-Encoding: identity");
    curl_easy_setopt(easy, CURLOPT_ACCEPT_ENCODING, "");
    if (const RequestBody* body = request_.body) {
      curl::append(headers_, "Content-Type: " + body->content_type);
      curl::append(headers_, "Expect:");
      curl_easy_setopt(easy, CURLOPT_POST, 1L);
      curl_easy_setopt(easy, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(body->bytes));
      curl_easy_setopt(easy, CURLOPT_UPLOAD_BUFFERSIZE, 512L * 1024);
      if (request_.is_put) curl_easy_setopt(easy, CURLOPT_CUSTOMREQUEST, "PUT");
    }
    curl_easy_setopt(easy, CURLOPT_HTTPHEADER, headers_.get());
  }

  curl::TransferCallbacks callbacks() {
    curl::TransferCallbacks callbacks;
    if (request_.body != nullptr) callbacks.source = request_.body->read;
    callbacks.sink = [this](std::span<const std::byte> bytes) {
      received_ += bytes.size();
      if (received_ > request_.most_bytes) {
        throw Error(ErrorCode::kTooLarge, "the response of the PACS exceeds the " +
                                              std::to_string(request_.most_bytes) +
                                              " bytes that are accepted");
      }
      write_all(target_, bytes);
      return true;
    };
    callbacks.header = [this](std::string_view line) { note_header(lower(line)); };
    return callbacks;
  }

  void note_header(std::string_view line) {
    // The standard has only this one text; its number of results and punctuation differ.
    if (line.starts_with("warning:") && line.find("additional results") != line.npos) {
      has_more_results_ = true;
    }
    constexpr std::string_view kEncoding = "content-encoding:";
    if (line.starts_with(kEncoding)) encoding_ = trimmed(line.substr(kEncoding.size()));
  }

  [[noreturn]] void throw_failure(CURLcode result) const {
    switch (result) {
      case CURLE_BAD_CONTENT_ENCODING:
        if (is_decoded(encoding_)) {
          throw PacsFailure(PacsFault::kUnreadable,
                            "the compressed response of the PACS is damaged");
        }
        throw PacsFailure(PacsFault::kRefused,
                          "the PACS compresses its responses in a way that cannot be read "
                          "(Content-Encoding), although this was not requested");
      case CURLE_OPERATION_TIMEDOUT:
        throw PacsFailure(PacsFault::kTimeout, "the PACS does not respond");
      case CURLE_PEER_FAILED_VERIFICATION:
      case CURLE_SSL_CONNECT_ERROR:
      case CURLE_SSL_CACERT_BADFILE:
        throw PacsFailure(PacsFault::kUnreachable,
                          "a trusted TLS connection to the PACS cannot be made");
      case CURLE_PARTIAL_FILE:
      case CURLE_RECV_ERROR:
      case CURLE_SEND_ERROR:
      case CURLE_GOT_NOTHING:
        throw PacsFailure(PacsFault::kUnreachable,
                          "the PACS closed the connection before its response was complete");
      default:
        throw PacsFailure(PacsFault::kUnreachable, "the connection to the PACS failed");
    }
  }

  const PeerRequest& request_;
  const std::stop_token stop_;
  const Descriptor target_;
  std::uint64_t received_ = 0;
  bool has_more_results_ = false;
  std::string encoding_;  // of the response's body
  curl::Headers headers_;
  const curl::Easy easy_;  // last: has pointers to the members above
};

}  // namespace

PeerResponseHead HttpPeer::send(const PeerRequest& request, const std::stop_token& stop) const {
  return Exchange(settings_, request, stop).perform();
}

}  // namespace isomesh::dicomweb
