// For threads that poll descriptors. Both throw Error kUnavailable without free descriptors.
#pragma once

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

}  // namespace isomesh
