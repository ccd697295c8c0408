#include "base/log.h"

#include <array>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "base/clock.h"

namespace isomesh {
namespace {

using Level = spdlog::level::level_enum;
using Json = nlohmann::ordered_json;

// Lines of LogLine come through this logger; their text is the members as they are to be written.
constexpr const char* kEvents = "events";

// Constant once start_log has returned.
LogFormat chosen_format = LogFormat::kText;
std::shared_ptr<spdlog::logger> events;

Level level_of(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return Level::debug;
    case LogLevel::kInfo:
      return Level::info;
    case LogLevel::kWarn:
      return Level::warn;
    case LogLevel::kError:
      return Level::err;
    case LogLevel::kOff:
      break;
  }
  return Level::off;
}

std::string quoted(std::string_view text) {
  // ASCII alone: other characters can reverse or hide a line on a terminal.
  return Json(text).dump(-1, ' ', true, Json::error_handler_t::replace);
}

bool is_plain(std::string_view text) {
  for (const unsigned char c : text) {
    if (c <= ' ' || c >= 0x7F || c == '"' || c == '=' || c == '\\') return false;
  }
  return !text.empty();
}

std::string member(std::string_view name, std::string_view written) {
  return chosen_format == LogFormat::kJson ? ',' + quoted(name) + ':' + std::string(written)
                                           : ' ' + std::string(name) + '=' + std::string(written);
}

std::string text_member(std::string_view name, std::string_view value) {
  const bool bare = chosen_format == LogFormat::kText && is_plain(value);
  return member(name, bare ? std::string(value) : quoted(value));
}

class Formatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) override {
    const std::string_view name(message.logger_name.data(), message.logger_name.size());
    const std::string_view payload(message.payload.data(), message.payload.size());
    const auto level = spdlog::level::to_string_view(message.level);
    std::string text;
    const std::string body =
        name == kEvents ? std::string(payload) : event("message") + text_member("text", payload);
    if (chosen_format == LogFormat::kJson) {
      text = "{\"time\":\"" + timestamp() + "\",\"level\":\"" +
             std::string(level.data(), level.size()) + '"' + body + "}\n";
    } else {
      text = timestamp() + ' ' + std::string(level.data(), level.size()) + body + '\n';
    }
    line.append(text.data(), text.data() + text.size());
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<Formatter>();
  }

  // What an event's members follow.
  static std::string event(std::string_view name) {
    return chosen_format == LogFormat::kJson ? ",\"event\":" + quoted(name)
                                             : ' ' + std::string(name);
  }
};

}  // namespace

struct LogLine::State {
  Level level;
  std::string text;
};

void start_log(LogFormat format, LogLevel level) {
  chosen_format = format;
  const auto sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("isomeshd", sink));
  events = std::make_shared<spdlog::logger>(kEvents, sink);
  events->set_level(level_of(level));
  sink->set_formatter(std::make_unique<Formatter>());
  spdlog::set_level(level_of(level));
}

LogLine::LogLine(std::string_view event, LogLevel level) {
  if (!events || !events->should_log(level_of(level))) return;
  state_ = std::make_unique<State>(State{level_of(level), Formatter::event(event)});
}

LogLine::~LogLine() {
  if (state_) events->log(state_->level, std::string_view(state_->text));
}

LogLine& LogLine::add(std::string_view name, std::string_view value) {
  if (state_) state_->text += text_member(name, value);
  return *this;
}

LogLine& LogLine::add_number(std::string_view name, std::int64_t value) {
  if (state_) state_->text += member(name, std::to_string(value));
  return *this;
}

LogLine& LogLine::add(std::string_view name, double value) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  if (state_) state_->text += member(name, text.data());
  return *this;
}

}  // namespace isomesh
