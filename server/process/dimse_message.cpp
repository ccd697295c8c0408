#include "server/process/dimse_message.h"

#include <algorithm>
#include <limits>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "proto/orders.h"

namespace isomesh::process {
namespace {

using Fields = nlohmann::json;
using std::chrono::seconds;

[[noreturn]] void throw_no_message() {
  throw Error(ErrorCode::kInternal, "A message between the daemon and isomesh-dimse is malformed.");
}

std::string one_line(const char* name, const Fields& fields) {
  return Fields{{name, fields}}.dump(-1, ' ', true, Fields::error_handler_t::replace) + '\n';
}

Fields fields_of(const DimseSending& order) {
  return {{"calling", order.calling},
          {"called", order.called},
          {"file", order.file.string()},
          {"sop_class", order.sop_class},
          {"instance", order.instance},
          {"timeout", order.timeout.count()},
          {"answer_timeout", order.answer_timeout.count()}};
}

Fields fields_of(const DimseReceiving& order) {
  return {{"called", order.called},
          {"calling", order.calling},
          {"folder", order.folder.string()},
          {"max_object_bytes", order.max_object_bytes},
          {"idle", order.idle.count()}};
}

Fields fields_of(const DimseSent& sent) {
  return {{"end", static_cast<int>(sent.end)}, {"status", sent.status}};
}

Fields fields_of(const DimseObject& object) {
  return {{"file", object.file},   {"called", object.called}, {"calling", object.calling},
          {"study", object.study}, {"series", object.series}, {"instance", object.instance}};
}

Fields fields_of(const DimseEnded& ended) { return {{"refusal", static_cast<int>(ended.refusal)}}; }

DimseSending sending_from(const Fields& fields) {
  DimseSending order;
  fields.at("calling").get_to(order.calling);
  fields.at("called").get_to(order.called);
  order.file = fields.at("file").get<std::string>();
  fields.at("sop_class").get_to(order.sop_class);
  fields.at("instance").get_to(order.instance);
  order.timeout = seconds(fields.at("timeout").get<std::int64_t>());
  order.answer_timeout = seconds(fields.at("answer_timeout").get<std::int64_t>());
  return order;
}

DimseReceiving receiving_from(const Fields& fields) {
  DimseReceiving order;
  fields.at("called").get_to(order.called);
  fields.at("calling").get_to(order.calling);
  order.folder = fields.at("folder").get<std::string>();
  fields.at("max_object_bytes").get_to(order.max_object_bytes);
  order.idle = seconds(fields.at("idle").get<std::int64_t>());
  return order;
}

// Numbers are looked at because the process that sent them reads what strangers write.
template <class Value>
Value one_of(const Fields& number, Value last) {
  const int value = number.get<int>();
  if (value < 0 || value > static_cast<int>(last)) throw_no_message();
  return static_cast<Value>(value);
}

std::uint16_t status_from(const Fields& number) {
  const int value = number.get<int>();
  if (value < 0 || value > std::numeric_limits<std::uint16_t>::max()) throw_no_message();
  return static_cast<std::uint16_t>(value);
}

std::string title_from(const Fields& text) {
  auto title = text.get<std::string>();
  if (!is_ae_title(title)) throw_no_message();
  return title;
}

std::string told_uid_from(const Fields& text) {
  auto uid = text.get<std::string>();
  if (!is_uid(uid)) throw_no_message();
  return uid;
}

// The process names its files by numbers.
std::string file_name_from(const Fields& text) {
  constexpr std::size_t kLongest = 20;
  auto name = text.get<std::string>();
  if (name.empty() || name.size() > kLongest ||
      !std::ranges::all_of(name, [](char c) { return c >= '0' && c <= '9'; })) {
    throw_no_message();
  }
  return name;
}

DimseReport report_of(const Fields& line) {
  if (const auto sent = line.find("sent"); sent != line.end()) {
    return DimseSent{.end = one_of(sent->at("end"), DimseEnd::kUnreadable),
                     .status = status_from(sent->at("status"))};
  }
  if (const auto ended = line.find("ended"); ended != line.end()) {
    return DimseEnded{.refusal = one_of(ended->at("refusal"), DimseRefusal::kOther)};
  }
  const Fields& object = line.at("object");
  return DimseObject{.file = file_name_from(object.at("file")),
                     .called = title_from(object.at("called")),
                     .calling = title_from(object.at("calling")),
                     .study = told_uid_from(object.at("study")),
                     .series = told_uid_from(object.at("series")),
                     .instance = told_uid_from(object.at("instance"))};
}

}  // namespace

std::string to_line(const DimseOrder& order) {
  if (const auto* sending = std::get_if<DimseSending>(&order)) {
    return one_line("send", fields_of(*sending));
  }
  return one_line("receive", fields_of(std::get<DimseReceiving>(order)));
}

std::string to_line(const DimseReport& report) {
  if (const auto* sent = std::get_if<DimseSent>(&report)) return one_line("sent", fields_of(*sent));
  if (const auto* object = std::get_if<DimseObject>(&report)) {
    return one_line("object", fields_of(*object));
  }
  return one_line("ended", fields_of(std::get<DimseEnded>(report)));
}

DimseOrder dimse_order_from(std::string_view line) {
  try {
    const Fields fields = Fields::parse(line);
    if (fields.contains("send")) return sending_from(fields.at("send"));
    return receiving_from(fields.at("receive"));
  } catch (const Fields::exception&) {
    throw_no_message();
  }
}

DimseReport dimse_report_from(std::string_view line) {
  try {
    return report_of(Fields::parse(line));
  } catch (const Fields::exception&) {
    throw_no_message();
  }
}

bool is_ae_title(std::string_view text) {
  constexpr std::size_t kLongest = 16;
  if (text.empty() || text.size() > kLongest || text.front() == ' ' || text.back() == ' ') {
    return false;
  }
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~' && c != '\\'; });
}

}  // namespace isomesh::process
