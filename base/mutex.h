// A mutex for clang's thread-safety analysis. Builds with clang++ fail at an access to a guarded
// member without the lock. Other compilers see a plain mutex.
//
//   Mutex mutex_;
//   int count_ ISOMESH_GUARDED_BY(mutex_) = 0;
//   void grow() ISOMESH_REQUIRES(mutex_);          // call with the lock held
//
//   Lock lock(mutex_);
//   changed_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return count_ > 0; });
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>

#if defined(__clang__)
#define ISOMESH_THREAD_ATTRIBUTE(x) __attribute__((x))
#else
#define ISOMESH_THREAD_ATTRIBUTE(x)
#endif

#define ISOMESH_GUARDED_BY(x) ISOMESH_THREAD_ATTRIBUTE(guarded_by(x))
#define ISOMESH_REQUIRES(...) ISOMESH_THREAD_ATTRIBUTE(requires_capability(__VA_ARGS__))
#define ISOMESH_EXCLUDES(...) ISOMESH_THREAD_ATTRIBUTE(locks_excluded(__VA_ARGS__))

namespace isomesh {

class ISOMESH_THREAD_ATTRIBUTE(capability("mutex")) Mutex {
 public:
  void lock() ISOMESH_THREAD_ATTRIBUTE(acquire_capability()) { mutex_.lock(); }
  void unlock() ISOMESH_THREAD_ATTRIBUTE(release_capability()) { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

// Holds a mutex for its lifetime, except between unlock() and lock().
class ISOMESH_THREAD_ATTRIBUTE(scoped_lockable) Lock {
 public:
  explicit Lock(Mutex& mutex) ISOMESH_THREAD_ATTRIBUTE(acquire_capability(mutex)) : lock_(mutex) {}
  ~Lock() ISOMESH_THREAD_ATTRIBUTE(release_capability()) = default;
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

  void unlock() ISOMESH_THREAD_ATTRIBUTE(release_capability()) { lock_.unlock(); }
  void lock() ISOMESH_THREAD_ATTRIBUTE(acquire_capability()) { lock_.lock(); }

 private:
  std::unique_lock<Mutex> lock_;
};

// Waits on a Lock; otherwise std::condition_variable_any, with stop tokens too.
using Condition = std::condition_variable_any;

// Returns after that time, or as soon as `stop` is requested.
inline void pause(const std::stop_token& stop, std::chrono::milliseconds time) {
  Mutex mutex;
  Lock lock(mutex);
  Condition().wait_for(lock, stop, time, [] { return false; });
}

}  // namespace isomesh
