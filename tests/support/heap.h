// The memory that the process has taken from the allocator and not given back.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <stop_token>
#include <thread>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#include <sanitizer/allocator_interface.h>
#else
#include <malloc.h>
#endif

namespace isomesh::test {

inline std::size_t heap_bytes() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return __sanitizer_get_current_allocated_bytes();
#else
  const struct mallinfo2 all = ::mallinfo2();
  return all.uordblks + all.hblkhd;
#endif
}

// The most memory that was taken since it was made, looked at some thousand times a second.
class HeapPeak {
 public:
  HeapPeak()
      : first_(heap_bytes()), most_(first_), looker_([this](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            look();
            std::this_thread::sleep_for(std::chrono::microseconds(100));
          }
        }) {}

  std::size_t bytes() {
    looker_ = {};
    look();
    return most_ - first_;
  }

 private:
  void look() { most_ = std::max(most_, heap_bytes()); }

  const std::size_t first_;
  std::size_t most_;
  std::jthread looker_;
};

}  // namespace isomesh::test
