#pragma once

namespace isomesh::net {

// Wakes a thread that polls descriptors. Thread safe.
class Wakeup {
 public:
  Wakeup();  // throws Error kUnavailable without free descriptors
  ~Wakeup();
  Wakeup(const Wakeup&) = delete;
  Wakeup& operator=(const Wakeup&) = delete;

  // Readable after ring() until clear().
  int descriptor() const { return event_; }
  void ring() const;
  void clear() const;

 private:
  const int event_;
};

// Returns a new epoll instance. Throws Error kUnavailable without free descriptors.
int new_epoll();

}  // namespace isomesh::net
