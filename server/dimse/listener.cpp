#include "server/dimse/listener.h"

#include <array>
#include <cerrno>
#include <string_view>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "server/process/child.h"

namespace isomesh::dimse {
namespace {

using process::DimseEnded;
using process::DimseObject;
using process::DimseRefusal;
using process::DimseVerdict;
using Clock = std::chrono::steady_clock;

// From one object to the next, or to the end: longer than any object takes, and not for ever.
constexpr std::chrono::minutes kLongestObject{30};
constexpr std::size_t kLongestLine = 4096;

// What a process says, line by line.
class Lines {
 public:
  explicit Lines(const process::Child& child) : child_(child) {}

  // Empty when it has ended, says too much or nothing for too long, or `stop` is requested.
  std::string next(const std::stop_token& stop) {
    const auto deadline = Clock::now() + kLongestObject;
    std::size_t end = std::string::npos;
    while ((end = text_.find('\n')) == std::string::npos) {
      if (stop.stop_requested() || Clock::now() >= deadline || text_.size() > kLongestLine) {
        return "";
      }
      pollfd waiting = {child_.socket().number(), POLLIN, 0};
      if (::poll(&waiting, 1, static_cast<int>(process::kLook.count())) <= 0) continue;
      std::array<char, kLongestLine> piece = {};
      const ssize_t count = ::read(child_.socket().number(), piece.data(), piece.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return "";
      text_.append(piece.data(), static_cast<std::size_t>(count));
    }
    std::string line = text_.substr(0, end + 1);
    text_.erase(0, end + 1);
    return line;
  }

 private:
  const process::Child& child_;
  std::string text_;
};

std::vector<std::string> titles_of(const orders::DimseSettings& settings) {
  std::vector<std::string> titles;
  for (const auto& [title, rule] : settings.routes) titles.push_back(title);
  return titles;
}

}  // namespace

net::Address listen_address(const orders::DimseSettings& settings) {
  try {
    net::Address address = net::parse_address(settings.listen);
    if (!address.is_unix()) return address;
  } catch (const Error&) {
    // It is told below, by the name that this file has for it.
  }
  throw invalid_parameter("dimse.listen", "must be HOST:PORT");
}

DimseListener::DimseListener(const ListenerServices& services,
                             const orders::DimseSettings& settings)
    : services_(services), settings_(settings), listener_(listen_address(settings)) {
  // Several threads wait for each connection, which one of them gets.
  ::fcntl(listener_.descriptor(), F_SETFL, O_NONBLOCK);
  for (std::size_t n = 0; n < settings_.associations; ++n) {
    threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
  }
}

void DimseListener::stop() {
  for (std::jthread& thread : threads_) thread.request_stop();
  threads_.clear();
}

Descriptor DimseListener::next_connection() const {
  pollfd waiting = {listener_.descriptor(), POLLIN, 0};
  if (::poll(&waiting, 1, static_cast<int>(process::kLook.count())) <= 0) return Descriptor();
  return Descriptor(::accept4(listener_.descriptor(), nullptr, nullptr, SOCK_CLOEXEC));
}

void DimseListener::serve(const std::stop_token& stop) {
  constexpr std::chrono::seconds kPause{1};
  while (!stop.stop_requested()) {
    try {
      const Descriptor peer = next_connection();
      if (peer.number() >= 0) serve_association(peer, stop);
    } catch (const std::exception& error) {
      if (stop.stop_requested()) return;
      log_error("an association was ended by an error: {}", error.what());
      std::this_thread::sleep_for(kPause);
    }
  }
}

void DimseListener::serve_association(const Descriptor& peer, const std::stop_token& stop) {
  const store::ScratchFolder scratch(services_.folder.scratch());
  process::Child child = services_.processes.take(Clock::now() + settings_.idle);
  child.say(process::to_line(process::DimseReceiving{.called = titles_of(settings_),
                                                     .calling = settings_.calling,
                                                     .folder = scratch.path(),
                                                     .max_object_bytes = settings_.max_object_bytes,
                                                     .idle = settings_.idle}),
            peer.number());
  Lines lines(child);
  while (true) {
    const std::string line = lines.next(stop);
    if (line.empty()) break;
    const process::DimseReport report = process::dimse_report_from(line);
    if (const auto* ended = std::get_if<DimseEnded>(&report)) return note_end(*ended);
    const auto* object = std::get_if<DimseObject>(&report);
    if (object == nullptr) break;
    const char verdict = static_cast<char>(keep(*object, scratch.path()));
    child.say(std::string_view(&verdict, 1));
  }
  if (stop.stop_requested()) return;
  // It neither ended well nor did it say why: what it has read may be the reason.
  services_.processes.renew();
  log_error("the process of an association ended {}",
            process::how_it_ended(child.ended_within(std::chrono::seconds(2))));
}

bool DimseListener::has_room(std::uint64_t more_bytes) const {
  return services_.blobs.has_room() &&
         services_.received.held_bytes() + more_bytes <= settings_.max_held_bytes;
}

DimseVerdict DimseListener::keep(const DimseObject& object, const std::filesystem::path& folder) {
  try {
    const std::filesystem::path file = folder / object.file;
    const store::Blob blob = store::digest_of(file);
    if (!has_room(blob.bytes)) return DimseVerdict::kNoRoom;
    services_.blobs.adopt(file, blob);
    services_.received.add({.route = object.called, .study = object.study, .series = object.series},
                           {.instance = object.instance, .blob = blob.key, .bytes = blob.bytes});
    services_.blobs.settle(blob.key);
    return DimseVerdict::kStored;
  } catch (const Error& error) {
    log_error("a received object could not be stored, and its sender is told so: {}", error.what());
    return DimseVerdict::kNoRoom;
  }
}

// At most once a second: whoever may connect could fill the trail, which nobody can empty.
void DimseListener::note_end(const DimseEnded& ended) {
  if (ended.refusal != DimseRefusal::kCalled && ended.refusal != DimseRefusal::kCalling) return;
  {
    const Lock lock(mutex_);
    if (Clock::now() < next_note_) return;
    next_note_ = Clock::now() + std::chrono::seconds(1);
  }
  LogLine("association", LogLevel::kWarn)
      .add("rejected", ended.refusal == DimseRefusal::kCalled ? "called-title" : "calling-title");
  services_.audit.add({.event = store::AuditEvent::kAuthenticationFailure,
                       .success = false,
                       .pacs = "dimse",
                       .direction = "in"});
}

}  // namespace isomesh::dimse
