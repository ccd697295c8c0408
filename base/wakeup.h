// For threads that poll descriptors. Making either throws Error kUnavailable without free
// descriptors.
#pragma once

#include <cstdint>

#include "base/descriptor.h"

namespace isomesh {

// Wakes a polling thread. Thread safe.
class Wakeup {
 public:
  Wakeup();

  // Readable after ring() until clear().
  int descriptor() const { return event_.number(); }
  void ring();
  // Returns true if it was rung.
  bool clear();

 private:
  const Descriptor event_;
};

Descriptor new_epoll();

// Adds the descriptor to those that `epoll` waits for, or with `is_watched` changes its events;
// `who` identifies it in them. Returns false if the system refuses.
bool watch(int epoll, int descriptor, std::uint32_t events, std::uint64_t who,
           bool is_watched = false);

// Adds the descriptor. Throws Error kUnavailable if the system refuses.
void watch_or_throw(int epoll, int descriptor, std::uint32_t events, std::uint64_t who);

}  // namespace isomesh
