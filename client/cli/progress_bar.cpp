#include "client/cli/progress_bar.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include <sys/ioctl.h>
#include <unistd.h>

#include "client/cli/text.h"

namespace isomesh::cli {
namespace {

constexpr std::size_t kLabelWidth = 9;
constexpr std::size_t kBarWidth = 32;
constexpr std::size_t kUsualColumns = 80;
constexpr std::chrono::milliseconds kRedraw{50};

std::size_t terminal_columns() {
  winsize size{};
  const bool known = ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return known ? size.ws_col : kUsualColumns;
}

}  // namespace

std::string bar_line(const std::string& label, double share, const std::string& note,
                     std::size_t columns) {
  const double bounded = std::isfinite(share) ? std::clamp(share, 0.0, 1.0) : 0.0;
  const auto filled = static_cast<std::size_t>(bounded * kBarWidth);
  std::string percent = std::to_string(static_cast<int>(100 * bounded));
  percent.insert(0, 3 - std::min<std::size_t>(3, percent.size()), ' ');
  std::string line = label;
  line.resize(std::max(label.size(), kLabelWidth), ' ');
  line +=
      '[' + std::string(filled, '#') + std::string(kBarWidth - filled, '.') + "] " + percent + " %";
  if (!note.empty()) line += "  " + note;
  if (line.size() > columns) line.resize(columns);
  return line;
}

std::string note_of(const Job& job) {
  if (job.state != JobState::kQueued) return "";
  return job.waiting_for
             ? "waiting for free space on the server's " + std::string(to_string(*job.waiting_for))
             : "waiting for a worker";
}

ProgressBar::ProgressBar(bool is_wanted) : visible_(is_wanted && ::isatty(STDERR_FILENO) == 1) {}

ProgressBar::~ProgressBar() { clear(); }

void ProgressBar::transfer(const std::string& label, std::uint64_t done, std::uint64_t total) {
  const double share = total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 1;
  draw(label, share, human_bytes(done) + " of " + human_bytes(total));
}

void ProgressBar::job(const Job& job) {
  draw(std::string(to_string(job.stage)), job.progress, note_of(job));
}

void ProgressBar::clear() {
  if (drawn_) std::cerr << "\r\x1b[K" << std::flush;
  drawn_ = false;
}

void ProgressBar::draw(const std::string& label, double share, const std::string& note) {
  if (!visible_) return;
  const auto now = std::chrono::steady_clock::now();
  if (drawn_ && label == label_ && share < 1 && now - drawn_at_ < kRedraw) return;
  // The last column stays empty: a full line would make some terminals scroll.
  std::cerr << '\r' << bar_line(label, share, note, terminal_columns() - 1) << "\x1b[K"
            << std::flush;
  drawn_ = true;
  label_ = label;
  drawn_at_ = now;
}

}  // namespace isomesh::cli
