// For threads that poll descriptors. Making either throws Error kUnavailable without free
// descriptors.
#pragma once

#include <cstdint>

namespace isomesh {

// Wakes a polling thread. Thread safe.
class Wakeup {
 public:
  Wakeup();
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  // Readable after ring() until clear().
  int descriptor() const { return event_; }
  void ring();
  // Returns true if it was rung.
  bool clear();

 private:
  const int event_;
};

int new_epoll();

// Adds the descriptor to those that `epoll` waits for, or with `is_watched` changes its events;
// `who` identifies it in them. Returns false if the system refuses.
bool watch(int epoll, int descriptor, std::uint32_t events, std::uint64_t who,
           bool is_watched = false);

}  // namespace isomesh
