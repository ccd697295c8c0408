#include "server/hospital/audit/syslog.h"

#include <algorithm>
#include <charconv>
#include <string>
#include <system_error>

#include "base/error.h"
#include "base/log.h"
#include "base/mutex.h"

namespace isomesh::audit {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kTimeout{10};
constexpr milliseconds kLook{500};  // interval between checks for new entries
constexpr milliseconds kLongestPause{60'000};
constexpr milliseconds kLastWord{2'000};  // time to send the entry about the end of the service
// The mark is set after this many entries, to limit repetition after a lost connection.
constexpr std::size_t kMostUnmarked = 100;

// The beginning of a line is not what was stored, so it is whole also in a damaged entry.
std::uint64_t number_of(std::string_view entry) {
  constexpr std::string_view kBefore = "{\"id\":";
  std::uint64_t number = 0;
  entry.remove_prefix(std::min(kBefore.size(), entry.size()));
  const auto end = std::from_chars(entry.data(), entry.data() + entry.size(), number);
  if (end.ec != std::errc()) throw Error(ErrorCode::kInternal, "an entry has no number");
  return number;
}

// Empty for a damaged entry, which must not hold up those after it.
std::string frame_of(std::string_view entry, const AuditSource& source) {
  try {
    return syslog_frame(entry, source);
  } catch (const Error& error) {
    log_error("entry {} of the audit trail is not sent to its collector: {}", number_of(entry),
              error.what());
    return "";
  }
}

}  // namespace

SyslogSender::SyslogSender(store::AuditTrail& trail, TlsServer server, AuditSource source)
    : trail_(trail),
      server_(std::move(server)),
      source_(std::move(source)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

void SyslogSender::stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  std::jthread last_word([this](const std::stop_token& stop) {
    pause(stop, kLastWord);
    cut_.request_stop();
  });
  thread_.join();
}

void SyslogSender::run(const std::stop_token& stop) {
  milliseconds wait = kLook;
  bool is_cut_off = false;
  while (!cut_.stop_requested()) {
    const bool is_last = stop.stop_requested();
    try {
      send_new(cut_.get_token());
      if (is_cut_off) log_info("the audit trail reaches its collector again");
      is_cut_off = false;
      wait = kLook;
    } catch (const std::exception& error) {
      connection_.reset();
      if (!is_cut_off && !is_last) {
        log_warning("the audit trail cannot be sent to its collector and is retried: {}",
                    error.what());
      }
      is_cut_off = true;
      wait = std::min(2 * wait, kLongestPause);
    }
    if (is_last) break;
    pause(stop, wait);
  }
  connection_.reset();
}

void SyslogSender::send_new(const std::stop_token& stop) {
  std::uint64_t last = trail_.sent();
  std::size_t unmarked = 0;
  const auto mark = [&] {
    connection_->await_receipt();
    trail_.note_sent(last);
    unmarked = 0;
  };
  trail_.read(last, [&](std::string_view entry) {
    const std::string frame = frame_of(entry, source_);
    if (connection_ && unmarked == 0 && !connection_->is_open()) connection_.reset();
    if (!connection_) connection_ = std::make_unique<TlsClient>(server_, kTimeout, stop);
    if (!frame.empty()) connection_->send(frame);
    last = number_of(entry);
    if (++unmarked == kMostUnmarked) mark();
  });
  if (unmarked > 0) mark();
}

}  // namespace isomesh::audit
