#include "server/hospital/dimse/message.h"

#include <algorithm>

#include "base/error.h"
#include "proto/dicom_uid.h"
#include "server/process/message.h"

namespace isomesh::dimse {

using process::line_of;
using process::ReadLine;
using process::throw_malformed;

constexpr DimseEnd last_of(DimseEnd /*value*/) { return DimseEnd::kUnreadable; }
constexpr DimseRefusal last_of(DimseRefusal /*value*/) { return DimseRefusal::kOther; }

void visit(Is<DimseSending> auto& self, auto&& field) {
  field("calling", self.calling);
  field("called", self.called);
  field("file", self.file);
  field("sop_class", self.sop_class);
  field("instance", self.instance);
  field("timeout", self.timeout);
  field("response_timeout", self.response_timeout);
}

void visit(Is<DimseReceiving> auto& self, auto&& field) {
  field("called", self.called);
  field("calling", self.calling);
  field("folder", self.folder);
  field("max_object_bytes", self.max_object_bytes);
  field("idle", self.idle);
}

void visit(Is<DimseSent> auto& self, auto&& field) {
  field("end", self.end);
  field("status", self.status);
}

void visit(Is<DimseObject> auto& self, auto&& field) {
  field("file", self.file);
  field("called", self.called);
  field("calling", self.calling);
  field("study", self.study);
  field("series", self.series);
  field("instance", self.instance);
}

void visit(Is<DimseEnded> auto& self, auto&& field) {
  field("refusal", self.refusal);
  field("called", self.called);
  field("calling", self.calling);
}

namespace {

constexpr const char* kSend = "send";
constexpr const char* kReceive = "receive";
constexpr const char* kSent = "sent";
constexpr const char* kObject = "object";
constexpr const char* kEnded = "ended";

// The process names its files by numbers.
bool is_file_name(std::string_view name) {
  constexpr std::size_t kLongest = 20;
  return !name.empty() && name.size() <= kLongest &&
         std::ranges::all_of(name, [](char c) { return c >= '0' && c <= '9'; });
}

// Texts are validated because their sender reads untrusted bytes.
bool is_harmless(const DimseObject& object) {
  return is_file_name(object.file) && is_ae_title(object.called) && is_ae_title(object.calling) &&
         is_uid(object.study) && is_uid(object.series) && is_uid(object.instance);
}

std::string line_for(const DimseSending& order) { return line_of(kSend, order); }
std::string line_for(const DimseReceiving& order) { return line_of(kReceive, order); }
std::string line_for(const DimseSent& sent) { return line_of(kSent, sent); }
std::string line_for(const DimseObject& object) { return line_of(kObject, object); }
std::string line_for(const DimseEnded& ended) { return line_of(kEnded, ended); }

}  // namespace

std::string to_line(const DimseOrder& order) {
  return std::visit([](const auto& one) { return line_for(one); }, order);
}

std::string to_line(const DimseReport& report) {
  return std::visit([](const auto& one) { return line_for(one); }, report);
}

DimseOrder dimse_order_from(std::string_view line) {
  const ReadLine message(line);
  if (auto order = message.find<DimseSending>(kSend)) return *std::move(order);
  if (auto order = message.find<DimseReceiving>(kReceive)) return *std::move(order);
  throw_malformed();
}

DimseReport dimse_report_from(std::string_view line) {
  const ReadLine message(line);
  if (const auto sent = message.find<DimseSent>(kSent)) return *sent;
  if (const auto ended = message.find<DimseEnded>(kEnded)) {
    for (const std::string& title : {ended->called, ended->calling}) {
      if (!title.empty() && !is_ae_title(title)) throw_malformed();
    }
    return *ended;
  }
  auto object = message.find<DimseObject>(kObject);
  if (!object || !is_harmless(*object)) throw_malformed();
  return *std::move(object);
}

bool is_ae_title(std::string_view text) {
  constexpr std::size_t kLongest = 16;
  if (text.empty() || text.size() > kLongest || text.front() == ' ' || text.back() == ' ') {
    return false;
  }
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~' && c != '\\'; });
}

}  // namespace isomesh::dimse
