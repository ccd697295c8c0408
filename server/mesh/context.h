#pragma once

#include <functional>
#include <stop_token>

#include "proto/error.h"

namespace isomesh::mesh {

// The services of the job that a kernel runs for: cancellation and progress. A default one never
// cancels and reports to nobody. Kernels check `stop` once per slab of layers and throw Error
// kCancelled. What they have written by then is indeterminate.
struct Context {
  std::stop_token stop;
  // Called from several threads with the share of the kernel's work that is done, 0..1.
  std::function<void(double)> progress;

  void throw_if_stopped() const {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "the job was cancelled");
  }

  // For the part [from, to] of the work.
  Context part(double from, double to) const {
    if (!progress) return *this;
    return {stop, [whole = progress, from, to](double done) { whole(from + (to - from) * done); }};
  }
};

}  // namespace isomesh::mesh
