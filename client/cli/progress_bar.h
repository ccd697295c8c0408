// A progress bar: one line on a terminal.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "proto/types.h"

namespace isomesh::cli {

// The line for `label` at `share`, such as `extract   [#####.....]  50 %  note`, cut to `columns`.
// `share` is clamped to 0..1. Pure.
std::string bar_line(const std::string& label, double share, const std::string& note,
                     std::size_t columns);

// The reason why a job waits; empty if it runs. Pure.
std::string note_of(const Job& job);

// Draws on standard error if that is a terminal and drawing is wanted; otherwise it does nothing.
// For one thread at a time.
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
