#include "server/hospital/c_store/listener.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <string_view>

#include <linux/tcp.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"
#include "server/hospital/orders/received.h"
#include "server/hospital/orders/unnamed.h"
#include "server/process/child.h"

namespace isomesh::c_store {
namespace {

using dimse::DimseEnded;
using dimse::DimseObject;
using dimse::DimseRefusal;
using dimse::DimseVerdict;
using Clock = std::chrono::steady_clock;

// Limit of the time between two objects, or to the end; longer than any object takes.
constexpr std::chrono::minutes kLongestObject{30};
constexpr std::size_t kLongestLine = 4096;

// Reads the lines that a process sends.
class Lines {
 public:
  explicit Lines(const process::Child& child) : child_(child) {}

  // Empty if the process has ended, sends too much or nothing for too long, or `stop` is requested.
  std::string next(const std::stop_token& stop) {
    const auto deadline = Clock::now() + kLongestObject;
    std::size_t end = std::string::npos;
    while ((end = text_.find('\n')) == std::string::npos) {
      is_late_ = Clock::now() >= deadline;
      if (stop.stop_requested() || is_late_ || text_.size() > kLongestLine) return "";
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

  // True if the last line was empty because nothing came for too long.
  bool is_late() const { return is_late_; }

 private:
  const process::Child& child_;
  std::string text_;
  bool is_late_ = false;
};

std::vector<std::string> titles_of(const orders::DimseSettings& settings) {
  std::vector<std::string> titles;
  for (const auto& [title, rule] : settings.routes) titles.push_back(title);
  return titles;
}

std::optional<TlsEntrance> entrance_of(const orders::DimseSettings& settings) {
  if (settings.certificate_file.empty()) return std::nullopt;
  return TlsEntrance(net::TlsIdentity{
      .certificate = {.option = "dimse.certificate-file", .path = settings.certificate_file},
      .key = {.option = "dimse.key-file", .path = settings.key_file},
      .authorities = {.option = "dimse.ca-file", .path = settings.ca_file}});
}

// When a connection last had bytes, and whether this side has sent some.
struct Traffic {
  bool has_answered = false;
  std::chrono::milliseconds idle{0};
};

std::optional<Traffic> traffic_of(int peer, const TlsRelay* tls) {
  if (tls != nullptr) {
    return Traffic{.has_answered = tls->has_answered(),
                   .idle = std::chrono::floor<std::chrono::milliseconds>(tls->idle())};
  }
  tcp_info info = {};
  socklen_t size = sizeof info;
  if (::getsockopt(peer, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  return Traffic{.has_answered = info.tcpi_data_segs_out != 0,
                 .idle = std::chrono::milliseconds(
                     std::min(info.tcpi_last_data_recv, info.tcpi_last_data_sent))};
}

}  // namespace

net::Address listen_address(const orders::DimseSettings& settings) {
  try {
    net::Address address = net::parse_address(settings.listen);
    if (!address.is_unix()) return address;
  } catch (const Error&) {
    // Reported below, with the key of the configuration file.
  }
  throw invalid_parameter("dimse.listen", "must be HOST:PORT");
}

DimseListener::DimseListener(const ListenerServices& services,
                             const orders::DimseSettings& settings)
    : services_(services),
      settings_(settings),
      entrance_(entrance_of(settings)),
      listener_(listen_address(settings)),
      places_(settings.associations, "associations"),
      acceptor_(listener_.descriptor(), {.wait_time = settings.idle}, hooks()) {
  for (std::size_t n = 0; n < settings_.associations; ++n) {
    threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
  }
}

AcceptorHooks DimseListener::hooks() {
  AcceptorHooks hooks = {.begin = [this](AssociationRequest& request) { return begin(request); },
                         .refused = [this](const std::string& party,
                                           net::TlsFault fault) { note_fault(party, fault); }};
  if (entrance_) {
    hooks.encrypt = [this](Descriptor peer) { return entrance_->accept(std::move(peer)); };
  }
  return hooks;
}

std::vector<std::string> DimseListener::calling_titles(const Association& association) const {
  std::vector<std::string> titles = settings_.calling;
  std::erase_if(titles, [&](const std::string& title) {
    const auto name = settings_.certificate_names.find(title);
    return name != settings_.certificate_names.end() &&
           !(association.tls && association.tls->is_certified_as(name->second));
  });
  return titles;
}

void DimseListener::stop() {
  acceptor_.stop();
  for (std::jthread& thread : threads_) thread.request_stop();
  {
    const Lock lock(mutex_);
    for (const auto& association : open_) association->end.request_stop();
  }
  threads_.clear();
}

bool DimseListener::begin(AssociationRequest& request) {
  try {
    auto association = std::make_shared<Association>();
    association->place = places_.take(request.party);
    association->tls = std::move(request.tls);
    association->peer = std::move(request.peer);
    association->party = request.party;
    const Lock lock(mutex_);
    open_.push_back(association);
    ready_.push_back(std::move(association));
    changed_.notify_one();
    return true;
  } catch (const Error& error) {
    make_room(error.code() == ErrorCode::kTooManyRequests ? request.party : "");
    return false;
  }
}

// Ends the association of that party (of all for "") that has been idle longest. Ends one at a
// time, because ending takes a moment.
void DimseListener::make_room(const std::string& party) {
  const Lock lock(mutex_);
  Association* idlest = nullptr;
  std::chrono::milliseconds longest{0};
  for (const auto& each : open_) {
    if (each->end.stop_requested()) return;
    std::chrono::milliseconds idle{0};
    if ((!party.empty() && each->party != party) || !is_idle(*each, idle) || idle < longest) {
      continue;
    }
    idlest = each.get();
    longest = idle;
  }
  if (idlest != nullptr) idlest->end.request_stop();
}

// Returns true if the association counts as idle; sets `idle` to the time since either side sent
// something.
bool DimseListener::is_idle(const Association& association, std::chrono::milliseconds& idle) {
  // A sender has its first object ready when it begins, but may need longer to read the next one.
  constexpr std::chrono::seconds kBeforeTheFirst{1};
  constexpr std::chrono::seconds kBetween{10};
  // The time from the start until the peer gets our response; it is our delay, not the peer's.
  constexpr std::chrono::seconds kNoResponse{5};
  const Clock::time_point told = association.told;
  if (told == Clock::time_point() || association.is_storing) return false;
  const auto traffic = traffic_of(association.peer.number(), association.tls.get());
  if (!traffic) return false;
  idle = std::chrono::floor<std::chrono::milliseconds>(Clock::now() - told);
  if (!traffic->has_answered) return idle >= kNoResponse;
  idle = std::min(idle, traffic->idle);
  return idle >= (association.has_sent ? kBetween : kBeforeTheFirst);
}

std::shared_ptr<DimseListener::Association> DimseListener::next_association(
    const std::stop_token& stop) {
  Lock lock(mutex_);
  changed_.wait(lock, stop, [&]() ISOMESH_REQUIRES(mutex_) { return !ready_.empty(); });
  if (stop.stop_requested() || ready_.empty()) return nullptr;
  auto next = std::move(ready_.front());
  ready_.pop_front();
  return next;
}

void DimseListener::serve(const std::stop_token& stop) {
  constexpr std::chrono::seconds kPause{1};
  while (auto association = next_association(stop)) {
    bool has_failed = false;
    try {
      serve_association(*association);
    } catch (const std::exception& error) {
      if (stop.stop_requested()) return;
      log_error("an association was ended by an error: {}", error.what());
      has_failed = true;
    }
    {
      const Lock lock(mutex_);
      std::erase(open_, association);
    }
    association.reset();
    acceptor_.wake();
    if (has_failed) std::this_thread::sleep_for(kPause);
  }
}

void DimseListener::serve_association(Association& association) {
  Transfers transfers;
  try {
    receive(association, transfers);
  } catch (...) {
    note_transfers(transfers, association.party);
    throw;
  }
  note_transfers(transfers, association.party);
}

void DimseListener::receive(Association& association, Transfers& transfers) {
  const std::stop_token stop = association.end.get_token();
  const store::ScratchFolder scratch(services_.folder.scratch());
  process::Child child = services_.processes.take(Clock::now() + settings_.idle, stop);
  child.send(dimse::to_line(dimse::DimseReceiving{.called = titles_of(settings_),
                                                  .calling = calling_titles(association),
                                                  .folder = scratch.path(),
                                                  .max_object_bytes = settings_.max_object_bytes,
                                                  .idle = settings_.idle}),
             association.peer.number());
  association.told = Clock::now();
  Lines lines(child);
  while (true) {
    const std::string line = lines.next(stop);
    if (line.empty()) break;
    const dimse::DimseReport report = dimse::dimse_report_from(line);
    if (const auto* ended = std::get_if<DimseEnded>(&report))
      return note_end(*ended, association.party);
    const auto* object = std::get_if<DimseObject>(&report);
    if (object == nullptr) break;
    association.is_storing = true;
    const DimseVerdict kept = keep(*object, stop, scratch.path());
    if (kept == DimseVerdict::kStored) {
      ++transfers[{object->called, object->calling, object->study}];
    }
    const char verdict = static_cast<char>(kept);
    child.send(std::string_view(&verdict, 1));
    association.told = Clock::now();
    association.has_sent = true;
    association.is_storing = false;
  }
  if (stop.stop_requested()) return;
  // The process ended abnormally, perhaps because of its input, so the prepared copies are replaced
  // too.
  services_.processes.renew();
  if (lines.is_late()) {
    log_error("an association took too long: nothing came for {} minutes", kLongestObject.count());
    return;
  }
  log_error("the process of an association ended {}",
            process::how_it_ended(child.ended_within(std::chrono::seconds(2))));
}

bool DimseListener::has_room(std::uint64_t more_bytes) const {
  return services_.blobs.has_room() &&
         services_.received.held_bytes() + more_bytes <= settings_.max_held_bytes;
}

DimseVerdict DimseListener::keep(const DimseObject& object, const std::stop_token& stop,
                                 const std::filesystem::path& folder) {
  DimseVerdict verdict = DimseVerdict::kNoRoom;
  std::vector<std::string> keys;
  std::vector<std::string> stored;
  try {
    const std::filesystem::path file = folder / object.file;
    const store::Blob blob = store::digest_of(file);
    if (!has_room(blob.bytes)) return verdict;
    keys.push_back(blob.key);  // a store that is stopped may have the bytes nevertheless
    services_.blobs.adopt(file, blob, "", stop);  // the owner of its order is not known yet
    stored.push_back(blob.key);
    const auto replaced = services_.received.add(
        {.route = object.called, .study = object.study, .series = object.series},
        {.instance = object.instance, .blob = blob.key, .bytes = blob.bytes});
    if (replaced) keys.push_back(*replaced);
    verdict = DimseVerdict::kStored;
  } catch (const Error& error) {
    log_error("a received object could not be stored, and its sender is told so: {}", error.what());
  }
  orders::erase_unnamed(services_.blobs, services_.volumes, std::move(keys), stored);
  return verdict;
}

void DimseListener::note_transfers(const Transfers& transfers, const std::string& party) {
  for (const auto& [what, count] : transfers) {
    const auto& [called, calling, study] = what;
    services_.audit.add({.event = store::AuditEvent::kTransferred,
                         .peer_name = orders::received_by(called),
                         .direction = "in",
                         .study = study,
                         .instances = count,
                         .peer = party,
                         .called = called,
                         .calling = calling});
  }
}

void DimseListener::note_end(const DimseEnded& ended, const std::string& party) {
  if (ended.refusal == DimseRefusal::kCalled) note_rejection("called-title", ended, party);
  if (ended.refusal != DimseRefusal::kCalling) return;
  const bool is_listed =
      std::ranges::find(settings_.calling, ended.calling) != settings_.calling.end();
  note_rejection(is_listed ? "certificate-name" : "calling-title", ended, party);
}

void DimseListener::note_fault(const std::string& party, net::TlsFault fault) {
  note_rejection(entrance_ ? net::text_of(fault, "the peer")
                           : "it uses TLS, but [dimse] has no certificate-file",
                 {}, party);
}

void DimseListener::note_rejection(std::string_view reason, const DimseEnded& ended,
                                   const std::string& party) {
  rejections_.add({std::string(reason), party, ended.called, ended.calling});
}

bool DimseListener::tell(const Rejection& rejection, std::uint64_t unlisted) const {
  try {
    services_.audit.add({.event = store::AuditEvent::kAuthenticationFailure,
                         .success = false,
                         .peer_name = "dimse",
                         .direction = "in",
                         .peer = rejection.peer,
                         .called = rejection.called,
                         .calling = rejection.calling,
                         .unlisted = unlisted});
  } catch (const std::exception& error) {
    log_error("the audit trail cannot be written to: {}", error.what());
    return false;
  }
  // Not before: while the trail cannot be written to, the same rejection is told again and again.
  LogLine("association", LogLevel::kWarn)
      .add("rejected", rejection.reason)
      .add("peer", rejection.peer)
      .add("unlisted", unlisted);
  return true;
}

}  // namespace isomesh::c_store
