#include "base/wakeup.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/error.h"

namespace isomesh {
namespace {

Descriptor checked(int number) {
  if (number < 0) throw Error(ErrorCode::kUnavailable, "no file descriptors are left");
  return Descriptor(number);
}

}  // namespace

Wakeup::Wakeup() : event_(checked(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK))) {}

void Wakeup::ring() {
  const std::uint64_t one = 1;
  // Fails only after 2^64 - 2 unread rings.
  [[maybe_unused]] const auto written = ::write(event_.number(), &one, sizeof one);
}

bool Wakeup::clear() {
  std::uint64_t count = 0;
  return ::read(event_.number(), &count, sizeof count) > 0;
}

Descriptor new_epoll() { return checked(::epoll_create1(EPOLL_CLOEXEC)); }

bool watch(int epoll, int descriptor, std::uint32_t events, std::uint64_t who, bool is_watched) {
  epoll_event event = {};
  event.events = events;
  event.data.u64 = who;
  return ::epoll_ctl(epoll, is_watched ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, descriptor, &event) == 0;
}

void watch_or_throw(int epoll, int descriptor, std::uint32_t events, std::uint64_t who) {
  if (watch(epoll, descriptor, events, who)) return;
  throw Error(ErrorCode::kUnavailable, "a connection cannot be watched");
}

}  // namespace isomesh
