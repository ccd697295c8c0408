// A libcurl transfer on the calling thread, with callbacks that may throw. Header only, for targets
// that link libcurl.
#pragma once

#include <cstddef>
#include <exception>
#include <functional>
#include <span>
#include <stop_token>
#include <string_view>
#include <utility>

#include <curl/curl.h>

#include "base/curl.h"
#include "base/error.h"

namespace isomesh::curl {

// Keeps an exception, which must not pass through libcurl, because that is C. The exception ends
// the transfer.
class Guard {
 public:
  template <class Run>
  std::size_t operator()(std::size_t on_failure, const Run& run) {
    try {
      return run();
    } catch (...) {
      thrown_ = std::current_exception();
      return on_failure;
    }
  }

  void rethrow() const {
    if (thrown_) std::rethrow_exception(thrown_);
  }

 private:
  std::exception_ptr thrown_;
};

// The callbacks of a transfer. An exception in one of them ends the transfer.
struct TransferCallbacks {
  // Fills the buffer with the next bytes of the request's body. Returns their number, 0 at the end.
  std::function<std::size_t(std::span<std::byte> buffer)> source = {};
  // Takes the next bytes of the response's body. False ends the transfer.
  std::function<bool(std::span<const std::byte> bytes)> sink = {};
  // Takes one header line of the response, with its line break; also those of interim responses.
  std::function<void(std::string_view line)> header = {};
};

// Runs the transfer that `easy` is set up for. Returns libcurl's result. Rethrows a callback's
// exception; throws Error kCancelled if `stop` is requested.
class Transfer {
 public:
  Transfer(CURL* easy, TransferCallbacks callbacks, std::stop_token stop)
      : easy_(easy), callbacks_(std::move(callbacks)), stop_(std::move(stop)) {}
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;

  CURLcode perform() {
    if (callbacks_.source) set(CURLOPT_READFUNCTION, on_source, CURLOPT_READDATA);
    if (callbacks_.sink) set(CURLOPT_WRITEFUNCTION, on_body, CURLOPT_WRITEDATA);
    if (callbacks_.header) set(CURLOPT_HEADERFUNCTION, on_header, CURLOPT_HEADERDATA);
    set(CURLOPT_XFERINFOFUNCTION, is_over, CURLOPT_XFERINFODATA);
    curl_easy_setopt(easy_, CURLOPT_NOPROGRESS, 0L);
    const CURLcode result = curl_easy_perform(easy_);
    guard_.rethrow();
    if (stop_.stop_requested()) throw Error(ErrorCode::kCancelled, "the transfer was stopped");
    return result;
  }

 private:
  template <class Function>
  void set(CURLoption option, Function* function, CURLoption data) {
    curl_easy_setopt(easy_, option, function);
    curl_easy_setopt(easy_, data, this);
  }

  static std::size_t on_source(char* buffer, std::size_t size, std::size_t count, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    return transfer.guard_(CURL_READFUNC_ABORT, [&] {
      return transfer.callbacks_.source(std::as_writable_bytes(std::span(buffer, size * count)));
    });
  }

  static std::size_t on_body(char* data, std::size_t size, std::size_t count, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    const auto bytes = std::as_bytes(std::span(data, size * count));
    return transfer.guard_(0, [&] { return transfer.callbacks_.sink(bytes) ? bytes.size() : 0; });
  }

  static std::size_t on_header(char* data, std::size_t size, std::size_t count, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    return transfer.guard_(0, [&] {
      transfer.callbacks_.header({data, size * count});
      return size * count;
    });
  }

  static int is_over(void* self, curl_off_t /*all*/, curl_off_t /*now*/, curl_off_t /*up_all*/,
                     curl_off_t /*up_now*/) {
    return static_cast<Transfer*>(self)->stop_.stop_requested() ? 1 : 0;
  }

  CURL* const easy_;
  const TransferCallbacks callbacks_;
  const std::stop_token stop_;
  Guard guard_;
};

}  // namespace isomesh::curl
