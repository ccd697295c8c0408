#include "tests/bench/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "tests/bench/numbers.h"

namespace isomesh::bench {
namespace {

constexpr double kWidth = 900;
constexpr double kHeight = 440;
constexpr double kLeft = 84;
constexpr double kRight = 600;  // the legend stands to the right of it
constexpr double kTop = 52;
constexpr double kBottom = 372;
constexpr double kMark = 4;

// Told apart by colour-blind readers too (M. Okabe, K. Ito).
constexpr std::array kColors = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                "#e69f00", "#56b4e9", "#333333"};

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else {
      result += c;
    }
  }
  return result;
}

// The largest of 1, 2 and 5 times a power of ten that is at most `value`.
double nice_below(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  const double lead = value / decade * (1 + 1e-9);
  return decade * (lead >= 5 ? 5 : lead >= 2 ? 2 : 1);
}

double nice_above(double value) {
  const double below = nice_below(value);
  if (below >= value * (1 - 1e-9)) return below;
  const double lead = below / std::pow(10, std::floor(std::log10(below * (1 + 1e-9))));
  return below * (lead > 1.5 && lead < 3 ? 2.5 : 2);
}

std::string tick_text(double value) {
  if (value >= 1000) return grouped(static_cast<std::uint64_t>(std::llround(value)));
  std::ostringstream text;
  text << value;
  return text.str();
}

// Maps the values of one axis to the page.
class PageAxis {
 public:
  PageAxis(const Axis& axis, double low, double high, double page_low, double page_high)
      : log_(axis.scale == Scale::kLog), page_low_(page_low), page_high_(page_high) {
    if (log_) {
      low_ = axis.ticks.empty() ? nice_below(low) : std::min(low, axis.ticks.front());
      high_ = axis.ticks.empty() ? nice_above(high) : std::max(high, axis.ticks.back());
      ticks_ = axis.ticks.empty() ? log_ticks() : axis.ticks;
    } else {
      constexpr double kTicks = 5;
      low_ = std::min(low, 0.0);
      const double step = nice_above((high - low_) / kTicks);
      low_ = std::floor(low_ / step) * step;
      high_ = std::ceil(high / step * (1 - 1e-9)) * step;
      ticks_ = axis.ticks;
      for (double i = 0; axis.ticks.empty() && low_ + i * step <= high_ + step / 2; ++i) {
        ticks_.push_back(low_ + i * step);
      }
    }
  }

  double place(double value) const {
    const double share =
        log_ ? (std::log(value) - std::log(low_)) / (std::log(high_) - std::log(low_))
             : (value - low_) / (high_ - low_);
    return page_low_ + share * (page_high_ - page_low_);
  }

  const std::vector<double>& ticks() const { return ticks_; }

 private:
  // Every power of ten; over a short range their doubles and fives too.
  std::vector<double> log_ticks() const {
    std::vector<double> ticks;
    const bool all = high_ / low_ <= 200;
    double tick = low_;
    while (tick <= high_ * (1 + 1e-9)) {
      const double exponent = std::log10(tick);
      const bool is_decade = std::abs(exponent - std::round(exponent)) < 1e-6;
      if (all || is_decade) ticks.push_back(tick);
      tick = nice_above(tick * 1.01);
    }
    return ticks;
  }

  bool log_;
  double low_ = 0;
  double high_ = 1;
  double page_low_;
  double page_high_;
  std::vector<double> ticks_;
};

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void settle() {
    if (low > high) *this = {1, 10};
    if (low == high) high = low == 0 ? 1 : low * 2;
  }
};

bool can_show(const Axis& axis, double value) {
  return std::isfinite(value) && (axis.scale == Scale::kLinear || value > 0);
}

class Drawing {
 public:
  explicit Drawing(const Plot& plot)
      : plot_(plot),
        x_(plot.x, range(0).low, range(0).high, kLeft, kRight),
        y_(plot.y, range(1).low, range(1).high, kBottom, kTop) {}

  std::string document() {
    out_ << R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 )" << kWidth << ' ' << kHeight
         << R"(" width=")" << kWidth << R"(" height=")" << kHeight
         << R"(" font-family="Helvetica, Arial, sans-serif" font-size="13" fill="#222">)" << '\n'
         << R"(<rect width="100%" height="100%" fill="#fff"/>)" << '\n';
    text(kLeft, 28, plot_.title, R"(font-size="16" font-weight="bold")");
    band();
    grid();
    for (std::size_t i = 0; i < plot_.series.size(); ++i) series(i);
    out_ << "</svg>\n";
    return out_.str();
  }

 private:
  Range range(std::size_t coordinate) const {
    Range result;
    for (const Series& series : plot_.series) {
      for (const auto& point : series.points) {
        if (is_shown(point)) result.include(point[coordinate]);
      }
    }
    result.settle();
    return result;
  }

  bool is_shown(const std::array<double, 2>& point) const {
    return can_show(plot_.x, point[0]) && can_show(plot_.y, point[1]);
  }

  void text(double x, double y, const std::string& what, const std::string& attributes = "") {
    out_ << "<text x=\"" << fixed(x, 1) << "\" y=\"" << fixed(y, 1) << "\" " << attributes << '>'
         << escaped(what) << "</text>\n";
  }

  void line(double x1, double y1, double x2, double y2, const char* color) {
    out_ << "<path d=\"M" << fixed(x1, 1) << ' ' << fixed(y1, 1) << 'L' << fixed(x2, 1) << ' '
         << fixed(y2, 1) << "\" stroke=\"" << color << "\"/>\n";
  }

  void band() {
    if (!plot_.band) return;
    const double from = x_.place(plot_.band->from);
    const double to = x_.place(plot_.band->to);
    out_ << "<rect x=\"" << fixed(from, 1) << "\" y=\"" << kTop << "\" width=\""
         << fixed(to - from, 1) << "\" height=\"" << kBottom - kTop << "\" fill=\"#f3ecd2\"/>\n";
    text((from + to) / 2, kTop - 6, plot_.band->label,
         R"(text-anchor="middle" font-size="11" fill="#7a6a2a")");
  }

  void grid() {
    for (const double tick : x_.ticks()) {
      line(x_.place(tick), kTop, x_.place(tick), kBottom, "#e2e2e2");
      text(x_.place(tick), kBottom + 18, tick_text(tick), R"(text-anchor="middle")");
    }
    for (const double tick : y_.ticks()) {
      line(kLeft, y_.place(tick), kRight, y_.place(tick), "#e2e2e2");
      text(kLeft - 8, y_.place(tick) + 4.5, tick_text(tick), R"(text-anchor="end")");
    }
    line(kLeft, kBottom, kRight, kBottom, "#555");
    line(kLeft, kTop, kLeft, kBottom, "#555");
    text((kLeft + kRight) / 2, kBottom + 44, plot_.x.label, R"(text-anchor="middle")");
    const double middle = (kTop + kBottom) / 2;
    text(22, middle, plot_.y.label,
         "text-anchor=\"middle\" transform=\"rotate(-90 22 " + fixed(middle, 1) + ")\"");
  }

  void series(std::size_t index) {
    const Series& series = plot_.series[index];
    const char* color = kColors[index % kColors.size()];
    std::string path;
    for (const auto& point : series.points) {
      if (!is_shown(point)) continue;
      path += (path.empty() ? "M" : "L") + fixed(x_.place(point[0]), 1) + ' ' +
              fixed(y_.place(point[1]), 1);
    }
    if (series.joined && !path.empty()) {
      out_ << "<path d=\"" << path << "\" fill=\"none\" stroke=\"" << color
           << "\" stroke-width=\"2\" stroke-linejoin=\"round\"/>\n";
    }
    for (const auto& point : series.points) {
      if (is_shown(point)) mark(x_.place(point[0]), y_.place(point[1]), index);
    }
    const double y = kTop + 10 + 24 * static_cast<double>(index);
    if (series.joined) line(kRight + 18, y, kRight + 42, y, color);
    mark(kRight + 30, y, index);
    text(kRight + 50, y + 4.5, series.label, R"(font-size="12")");
  }

  // A shape for each series, so that colour is not all that tells them apart.
  void mark(double x, double y, std::size_t index) {
    const char* color = kColors[index % kColors.size()];
    const std::string stroke = plot_.series[index].joined ? "#fff" : "#000";
    if (index % 3 == 0) {
      out_ << "<circle cx=\"" << fixed(x, 1) << "\" cy=\"" << fixed(y, 1) << "\" r=\"" << kMark;
    } else if (index % 3 == 1) {
      out_ << "<rect x=\"" << fixed(x - kMark, 1) << "\" y=\"" << fixed(y - kMark, 1)
           << "\" width=\"" << 2 * kMark << "\" height=\"" << 2 * kMark;
    } else {
      out_ << "<path d=\"M" << fixed(x, 1) << ' ' << fixed(y - kMark - 1.5, 1) << 'l' << kMark + 1
           << ' ' << 2 * kMark << 'h' << -2 * (kMark + 1) << 'z';
    }
    out_ << "\" fill=\"" << color << "\" stroke=\"" << stroke << "\"/>\n";
  }

  const Plot& plot_;
  const PageAxis x_;
  const PageAxis y_;
  std::ostringstream out_;
};

}  // namespace

std::string to_svg(const Plot& plot) { return Drawing(plot).document(); }

}  // namespace isomesh::bench
