// One line on a terminal that shows how far something is.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "proto/types.h"

namespace isomesh::cli {

// The line for `label` at `share` (0..1, bounded), such as `extract   [#####.....]  50 %  note`,
// cut to `columns`. Pure.
std::string bar_line(const std::string& label, double share, const std::string& note,
                     std::size_t columns);

// What a job waits for; empty once it runs. Pure.
std::string note_of(const Job& job);

// Draws on standard error when that is wanted and a terminal, and does nothing otherwise. One
// thread at a time.
class ProgressBar {
 public:
  explicit ProgressBar(bool is_wanted = true);
  ~ProgressBar();  // clears the line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  bool visible() const { return visible_; }

  void transfer(const std::string& label, std::uint64_t done, std::uint64_t total);
  void job(const Job& job);
  void clear();

 private:
  void draw(const std::string& label, double share, const std::string& note);

  bool visible_;
  bool drawn_ = false;
  std::string label_;
  std::chrono::steady_clock::time_point drawn_at_;
};

}  // namespace isomesh::cli
