#include "server/store/s3/request.h"

#include <algorithm>
#include <ctime>
#include <span>
#include <utility>

#include "base/curl_transfer.h"
#include "base/error.h"
#include "base/log.h"
#include "base/sha256.h"
#include "base/text.h"

namespace isomesh::store {
namespace {

// Limit for responses without a sink, such as a page of a list.
constexpr std::uint64_t kAskedFor = 1 << 20;  // bytes; larger bodies wait for "100 Continue"
constexpr std::size_t kLongestText = std::size_t{4} << 20;
constexpr std::size_t kIdleConnections = 16;

// The file existed at the start; a read error may mean that it is being replaced.
S3Credentials credentials_now(const std::filesystem::path& file) {
  try {
    return read_s3_credentials(file);
  } catch (const Error& error) {
    log_error("the keys of --blob-credentials cannot be read again: {}", error.what());
    throw Error(ErrorCode::kUnavailable,
                "the storage of volumes and meshes cannot be reached now; nothing is lost");
  }
}

// A running transfer; libcurl has pointers to it.
class Attempt {
 public:
  Attempt(const S3ClientOptions& options, const S3Request& request, std::stop_token stop,
          CURL* easy)
      : options_(options), request_(request), stop_(std::move(stop)), easy_(easy) {
    set_connection();
    set_request();
  }

  S3Response perform() {
    const CURLcode result = curl::Transfer(easy_, callbacks(), stop_).perform();
    if (result == CURLE_OK) {
      curl_easy_getinfo(easy_, CURLINFO_RESPONSE_CODE, &response_.status);
    } else {
      log_debug("the storage: {}", curl_easy_strerror(result));
      response_.status = 0;
    }
    return std::move(response_);
  }

 private:
  void set_connection() {
    curl::connect_directly(easy_, options_.authorities);
    curl_easy_setopt(easy_, CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
    curl_easy_setopt(easy_, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(options_.connect.count()));
    if (request_.is_quick) {
      curl_easy_setopt(easy_, CURLOPT_TIMEOUT_MS, static_cast<long>(options_.quick.count()));
    }
    if (request_.is_sent_once) curl_easy_setopt(easy_, CURLOPT_FRESH_CONNECT, 1L);
    curl_easy_setopt(easy_, CURLOPT_LOW_SPEED_LIMIT, 1024L);
    curl_easy_setopt(easy_, CURLOPT_LOW_SPEED_TIME, static_cast<long>(options_.stall.count()));
    curl_easy_setopt(easy_, CURLOPT_BUFFERSIZE, 512L * 1024);
    curl_easy_setopt(easy_, CURLOPT_UPLOAD_BUFFERSIZE, 512L * 1024);
    curl_easy_setopt(easy_, CURLOPT_USERAGENT, "isomesh");
  }

  void set_request() {
    const S3Address& address = options_.address;
    const S3Credentials credentials = credentials_now(options_.credentials);
    const std::string key = request_.key.empty() ? "" : address.prefix + request_.key;
    const std::string url = address.endpoint + address.path + '/' + key +
                            (request_.query.empty() ? "" : '?' + request_.query);
    curl_easy_setopt(easy_, CURLOPT_URL, url.c_str());
    curl_easy_setopt(easy_, CURLOPT_AWS_SIGV4, ("aws:amz:" + address.region + ":s3").c_str());
    curl_easy_setopt(easy_, CURLOPT_USERNAME, credentials.access_key.c_str());
    curl_easy_setopt(easy_, CURLOPT_PASSWORD, credentials.secret_key.c_str());
    curl::append(headers_,
                 "x-amz-content-sha256: " +
                     (request_.sha256.empty() ? sha256_of(request_.text) : request_.sha256));
    if (!credentials.session_token.empty()) {
      curl::append(headers_, "x-amz-security-token: " + credentials.session_token);
    }
    if (!request_.condition.empty()) curl::append(headers_, request_.condition);
    set_method();
    curl_easy_setopt(easy_, CURLOPT_HTTPHEADER, headers_.get());
  }

  void set_method() {
    const std::string_view method = request_.method;
    if (method == "HEAD") {
      curl_easy_setopt(easy_, CURLOPT_NOBODY, 1L);
    } else if (method == "PUT") {
      // For a small body, waiting for "100 Continue" takes longer than sending it. (If the header
      // "Expect" were removed, libcurl would sign it as an empty one.)
      if (body_bytes() < kAskedFor) curl_easy_setopt(easy_, CURLOPT_EXPECT_100_TIMEOUT_MS, 1L);
      curl_easy_setopt(easy_, CURLOPT_UPLOAD, 1L);
      curl_easy_setopt(easy_, CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(body_bytes()));
      curl_easy_setopt(easy_, CURLOPT_SEEKFUNCTION, seek);
      curl_easy_setopt(easy_, CURLOPT_SEEKDATA, this);
    } else if (method == "POST") {
      curl::append(headers_, "Content-Type: application/xml");
      curl_easy_setopt(easy_, CURLOPT_POST, 1L);
      curl_easy_setopt(easy_, CURLOPT_POSTFIELDSIZE_LARGE,
                       static_cast<curl_off_t>(request_.text.size()));
      // Without a body, libcurl would read one from its callback.
      curl_easy_setopt(easy_, CURLOPT_POSTFIELDS,
                       request_.text.empty() ? "" : request_.text.data());
    } else if (method != "GET") {
      curl_easy_setopt(easy_, CURLOPT_CUSTOMREQUEST, request_.method);
    }
  }

  std::uint64_t body_bytes() const {
    return request_.file == nullptr ? request_.text.size() : request_.bytes;
  }

  curl::TransferCallbacks callbacks() {
    return {.source = [this](std::span<std::byte> buffer) { return give(buffer); },
            .sink = [this](std::span<const std::byte> bytes) { return take(bytes); },
            .header = [this](std::string_view line) { take_header(line); }};
  }

  std::size_t give(std::span<std::byte> buffer) {
    const auto left = std::min<std::uint64_t>(buffer.size(), body_bytes() - sent_);
    const auto target = buffer.first(static_cast<std::size_t>(left));
    std::size_t read = target.size();
    if (request_.file != nullptr) {
      read = request_.file->read_at(request_.begin + sent_, target);
    } else {
      const auto text = std::as_bytes(std::span(request_.text));
      std::ranges::copy(text.subspan(static_cast<std::size_t>(sent_), read), target.begin());
    }
    sent_ += read;
    return read;
  }

  static int seek(void* self, curl_off_t offset, int /*origin*/) {
    static_cast<Attempt*>(self)->sent_ = static_cast<std::uint64_t>(offset);
    return CURL_SEEKFUNC_OK;
  }

  bool take(std::span<const std::byte> bytes) {
    long status = 0;
    curl_easy_getinfo(easy_, CURLINFO_RESPONSE_CODE, &status);
    const bool is_wanted = status == kS3Ok || status == kS3Partial;
    if (request_.sink != nullptr && is_wanted) {
      pass_on(bytes, status == kS3Partial);
    } else if (response_.text.size() + bytes.size() <= kLongestText) {
      response_.text.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    } else {
      return false;
    }
    return true;
  }

  // A peer without support for ranges sends the whole object again.
  void pass_on(std::span<const std::byte> bytes, bool is_part) {
    const std::uint64_t unwanted = is_part ? 0 : request_.sink_begin;
    const std::uint64_t skipped = std::min<std::uint64_t>(
        bytes.size(), unwanted - std::min<std::uint64_t>(unwanted, received_));
    received_ += bytes.size();
    bytes = bytes.subspan(static_cast<std::size_t>(skipped));
    // Bytes beyond the object's size are ignored.
    bytes = bytes.first(static_cast<std::size_t>(
        std::min<std::uint64_t>(bytes.size(), request_.bytes - response_.taken)));
    if (!bytes.empty()) (*request_.sink)(bytes);
    response_.taken += bytes.size();
  }

  void take_header(std::string_view line) {
    const std::size_t colon = line.find(':');
    // "100 Continue" precedes the response and has headers of its own.
    if (line.starts_with("HTTP/")) response_.headers.clear();
    constexpr std::size_t kMostHeaders = 100;
    if (colon != line.npos && response_.headers.size() < kMostHeaders) {
      response_.headers[lower(line.substr(0, colon))] = trimmed(line.substr(colon + 1));
    }
  }

  const S3ClientOptions& options_;
  const S3Request& request_;
  const std::stop_token stop_;
  CURL* const easy_;
  curl::Headers headers_;
  S3Response response_;
  std::uint64_t sent_ = 0;
  std::uint64_t received_ = 0;
};

}  // namespace

std::string S3Response::header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

Time S3Response::now() const {
  const std::time_t time = curl_getdate(header("date").c_str(), nullptr);
  return time < 0 ? std::chrono::system_clock::now() : Time(std::chrono::seconds(time));
}

curl::Easy S3Connections::take() const {
  {
    const Lock lock(mutex_);
    if (!idle_.empty()) {
      curl::Easy connection = std::move(idle_.back());
      idle_.pop_back();
      return connection;
    }
  }
  return curl::make_easy();
}

// Keeps the open connection and resets all options.
void S3Connections::give_back(curl::Easy connection) const {
  curl_easy_reset(connection.get());
  const Lock lock(mutex_);
  if (idle_.size() < kIdleConnections) idle_.push_back(std::move(connection));
}

S3Response S3Connections::attempt(const S3Request& request, const std::stop_token& stop) const {
  curl::Easy connection = take();
  S3Response response = Attempt(options_, request, stop, connection.get()).perform();
  // A connection with an aborted transfer may still have bytes of it.
  if (response.status != 0) give_back(std::move(connection));
  return response;
}

}  // namespace isomesh::store
