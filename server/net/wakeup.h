#pragma once

namespace isomesh::net {

// Wakes a thread that waits for descriptors. Thread safe.
class Wakeup {
 public:
  Wakeup();  // throws Error kUnavailable when there are no descriptors
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  // Can be read as soon as ring() was called, until clear().
  int descriptor() const { return event_; }
  void ring() const;
  void clear() const;

 private:
  const int event_;
};

// A new epoll instance; throws Error kUnavailable when there are no descriptors.
int new_epoll();

}  // namespace isomesh::net
