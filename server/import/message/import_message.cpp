#include "server/import/message/import_message.h"

#include <algorithm>

#include "proto/dicom_uid.h"
#include "server/process/message.h"

namespace isomesh::import {

void visit(Is<PeersSeries> auto& self, auto&& field) {
  field("content_type", self.content_type);
  field("study", self.study);
  field("series", self.series);
  field("instances", self.instances);
}

void visit(Is<ImportOptions> auto& self, auto&& field) {
  field("raw", self.raw);
  field("series", self.series);
  field("volume", self.volume);
  field("member", self.member);
  field("masks", self.masks);
  field("accept", self.accept);
  field("nifti_form", self.nifti_form);
  field("modality", self.modality);
  field("spacing", self.spacing);
  field("peers", self.peers);
}

void visit(Is<ImportTask> auto& self, auto&& field) {
  field("source", self.source);
  field("scratch", self.scratch);
  field("target", self.target);
  field("options", self.options);
  field("max_sample_bytes", self.limits.max_sample_bytes);
}

void visit(Is<ImportBounds> auto& self, auto&& field) {
  field("memory_bytes", self.memory_bytes);
  field("seconds", self.time);
}

void visit(Is<ResponseTask> auto& self, auto&& field) { field("source", self.source); }

template <class Order>
requires std::is_same_v<std::remove_const_t<Order>, ImportOrder> ||
    std::is_same_v<std::remove_const_t<Order>, ResponseOrder>
void visit(Order& self, auto&& field) {
  field("task", self.task);
  field("bounds", self.bounds);
}

void visit(Is<PeersObject> auto& self, auto&& field) {
  field("study", self.study);
  field("series", self.series);
  field("instance", self.instance);
  field("patient_id", self.patient_id);
  field("patient_name", self.patient_name);
  field("study_date", self.study_date);
  field("study_description", self.study_description);
  field("modality", self.modality);
  field("series_description", self.series_description);
  field("instances", self.instances);
  field("failure", self.failure);
  field("segmented_series", self.segmented_series);
  field("workitem_state", self.workitem_state);
  field("readiness", self.readiness);
  field("procedures", self.procedures);
}

void visit(Is<PeersResponse> auto& self, auto&& field) {
  field("objects", self.objects);
  field("stored", self.stored);
  field("failed", self.failed);
}

namespace {

using process::line_of;
using process::ReadLine;
using process::throw_malformed;

constexpr const char* kImport = "import";
constexpr const char* kBegun = "begun";
constexpr const char* kReading = "reading";
constexpr const char* kVolume = "volume";
constexpr const char* kResponse = "response";
constexpr const char* kError = "error";

// UIDs become parts of URLs, so they are validated again: their sender reads untrusted bytes.
void check_uids(const PeersResponse& response) {
  for (const auto* objects : {&response.objects, &response.stored, &response.failed}) {
    for (const PeersObject& object : *objects) {
      for (const std::string* uid :
           {&object.study, &object.series, &object.instance, &object.segmented_series}) {
        if (!uid->empty() && !is_uid(*uid)) throw_malformed();
      }
    }
  }
}

// Validates a format's name before it is logged, because its sender reads untrusted files.
void check_word(const std::string& text) {
  constexpr std::size_t kLongest = 16;
  const bool plain = text.size() <= kLongest && std::ranges::all_of(text, [](char c) {
                       return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
                     });
  if (!plain) throw_malformed();
}

void add_line(ImportReport& report, const ReadLine& line) {
  if (line.find<bool>(kBegun)) report.begun = true;
  if (const auto format = line.find<std::string>(kReading)) {
    check_word(*format);
    report.reading = *format;
  }
  if (auto volume = line.find<Volume>(kVolume)) report.volume = std::move(volume);
  if (auto response = line.find<PeersResponse>(kResponse)) {
    check_uids(*response);
    report.response = std::move(response);
  }
  if (const auto problem = line.find<Problem>(kError)) report.error = to_error(*problem);
}

}  // namespace

std::string to_message(const ImportOrder& order) { return line_of(kImport, order); }
std::string to_message(const ResponseOrder& order) { return line_of(kResponse, order); }

std::variant<ImportOrder, ResponseOrder> order_from(std::string_view message) {
  const ReadLine line(message);
  if (auto order = line.find<ImportOrder>(kImport)) return *std::move(order);
  if (auto order = line.find<ResponseOrder>(kResponse)) return *std::move(order);
  throw_malformed();
}

std::string begun_message() { return line_of(kBegun, true); }

std::string reading_message(std::string_view format) {
  return line_of(kReading, std::string(format));
}

std::string volume_message(const Volume& volume) {
  JsonTree line;
  json_values::write_record(json_values::member(line.root(), kVolume), volume);
  return dump(line.root()) + '\n';
}

std::string response_message(const PeersResponse& response) { return line_of(kResponse, response); }
std::string error_message(const Error& error) { return line_of(kError, error); }

ImportReport report_from(std::string_view messages) {
  ImportReport report;
  for (std::size_t next = 0;;) {
    const std::size_t end = messages.find('\n', next);
    if (end == std::string_view::npos) return report;
    add_line(report, ReadLine(messages.substr(next, end - next)));
    next = end + 1;
  }
}

}  // namespace isomesh::import
