#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <optional>

namespace isomesh::http {

// A number of places for requests that hold a thread for long, so that they never hold all of them.
// Thread safe.
class Slots {
 public:
  explicit Slots(std::size_t count) : count_(count), free_(static_cast<std::ptrdiff_t>(count)) {}

  // How many are taken at the moment.
  std::size_t taken() const {
    return count_ - static_cast<std::size_t>(std::max<std::ptrdiff_t>(free_, 0));
  }

  // A place, given back when it goes.
  class Place {
   public:
    explicit Place(Slots* slots) : slots_(slots) {}
    Place(Place&& other) noexcept : slots_(other.slots_) { other.slots_ = nullptr; }
    Place& operator=(Place&&) = delete;
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    ~Place() {
      if (slots_ != nullptr) ++slots_->free_;
    }

   private:
    Slots* slots_;
  };

  // Empty when all places are taken.
  std::optional<Place> try_take() {
    if (--free_ >= 0) return Place(this);
    ++free_;
    return std::nullopt;
  }

 private:
  const std::size_t count_;
  std::atomic<std::ptrdiff_t> free_;
};

}  // namespace isomesh::http
