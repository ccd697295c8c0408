#include "server/process/import_message.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "proto/orders.h"

namespace isomesh::process {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kBegun = "begun";
constexpr std::string_view kReading = "reading";
constexpr std::string_view kVolume = "volume";
constexpr std::string_view kAnswer = "answer";
constexpr std::string_view kError = "error";

[[noreturn]] void throw_malformed() {
  throw Error(ErrorCode::kInternal, "A message between the daemon and an import is malformed.");
}

std::string line_of(std::string_view name, const Json& value) {
  Json json;
  json[std::string(name)] = value;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

Json to_json(const RawDescription& raw) {
  return {{"dims", raw.dims},
          {"type", std::string(to_string(raw.type))},
          {"origin", raw.geometry.origin},
          {"spacing", raw.geometry.spacing},
          {"direction", raw.geometry.direction},
          {"big_endian", raw.big_endian}};
}

RawDescription raw_from(const Json& json) {
  RawDescription raw;
  const auto type = from_string<SampleType>(json.at("type").get<std::string>());
  if (!type) throw_malformed();
  raw.type = *type;
  json.at("dims").get_to(raw.dims);
  json.at("origin").get_to(raw.geometry.origin);
  json.at("spacing").get_to(raw.geometry.spacing);
  json.at("direction").get_to(raw.geometry.direction);
  json.at("big_endian").get_to(raw.big_endian);
  return raw;
}

template <class Value>
Json optional_json(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json to_json(const PeersSeries& peers) {
  return {{"content_type", peers.content_type},
          {"study", peers.study},
          {"series", peers.series},
          {"instances", peers.instances}};
}

PeersSeries peers_from(const Json& json) {
  PeersSeries peers;
  json.at("content_type").get_to(peers.content_type);
  json.at("study").get_to(peers.study);
  json.at("series").get_to(peers.series);
  json.at("instances").get_to(peers.instances);
  return peers;
}

Json to_json(const ImportBounds& bounds) {
  return {{"memory_bytes", bounds.memory_bytes}, {"seconds", bounds.time.count()}};
}

ImportBounds bounds_from(const Json& json) {
  ImportBounds bounds;
  json.at("memory_bytes").get_to(bounds.memory_bytes);
  bounds.time = std::chrono::seconds(json.at("seconds").get<std::int64_t>());
  return bounds;
}

Json to_json(const ImportOptions& options) {
  const auto form = options.nifti_form ? std::optional(std::string(to_string(*options.nifti_form)))
                                       : std::nullopt;
  return {{"raw", options.raw ? to_json(*options.raw) : Json(nullptr)},
          {"series", options.series},
          {"volume", optional_json(options.volume)},
          {"member", options.member},
          {"accept", options.accept},
          {"nifti_form", optional_json(form)},
          {"peers", options.peers ? to_json(*options.peers) : Json(nullptr)}};
}

ImportOptions options_from(const Json& json) {
  ImportOptions options;
  if (!json.at("raw").is_null()) options.raw = raw_from(json.at("raw"));
  json.at("series").get_to(options.series);
  if (!json.at("volume").is_null()) options.volume = json.at("volume").get<std::uint32_t>();
  json.at("member").get_to(options.member);
  json.at("accept").get_to(options.accept);
  if (!json.at("nifti_form").is_null()) {
    options.nifti_form = from_string<NiftiForm>(json.at("nifti_form").get<std::string>());
  }
  if (!json.at("peers").is_null()) options.peers = peers_from(json.at("peers"));
  return options;
}

Json to_json(const Error& error) {
  Json fields = Json::array();
  for (const FieldError& field : error.fields()) fields.push_back({field.field, field.message});
  Json choices = Json::array();
  for (const Choice& choice : error.remedy().choices) {
    choices.push_back({choice.parameter, choice.value, choice.title});
  }
  return {{"code", std::string(describe(error.code()).name)},
          {"detail", std::string(error.what())},
          {"fields", fields},
          {"overridable", error.remedy().overridable},
          {"choices", choices}};
}

Error error_from(const Json& json) {
  std::vector<FieldError> fields;
  for (const Json& field : json.at("fields")) {
    fields.push_back({field.at(0).get<std::string>(), field.at(1).get<std::string>()});
  }
  Remedy remedy = {.overridable = json.at("overridable").get<std::string>()};
  for (const Json& choice : json.at("choices")) {
    remedy.choices.push_back({choice.at(0).get<std::string>(), choice.at(1).get<std::string>(),
                              choice.at(2).get<std::string>()});
  }
  const Error error(error_code_of(json.at("code").get<std::string>()),
                    json.at("detail").get<std::string>(), std::move(fields));
  return error.with_remedy(std::move(remedy));
}

Json to_json(const PeersObject& object) {
  return {{"study", object.study},
          {"series", object.series},
          {"instance", object.instance},
          {"patient_id", object.patient_id},
          {"modality", object.modality},
          {"series_description", object.series_description},
          {"instances", optional_json(object.instances)},
          {"failure", optional_json(object.failure)}};
}

Json to_json(const std::vector<PeersObject>& objects) {
  Json list = Json::array();
  for (const PeersObject& object : objects) list.push_back(to_json(object));
  return list;
}

// UIDs go into addresses, so they are looked at once more: the process that sent them reads what a
// stranger wrote.
std::string uid_from(const Json& json) {
  auto uid = json.get<std::string>();
  if (!uid.empty() && !is_uid(uid)) throw_malformed();
  return uid;
}

std::vector<PeersObject> objects_from(const Json& list) {
  std::vector<PeersObject> objects;
  for (const Json& json : list) {
    PeersObject& object = objects.emplace_back();
    object.study = uid_from(json.at("study"));
    object.series = uid_from(json.at("series"));
    object.instance = uid_from(json.at("instance"));
    json.at("patient_id").get_to(object.patient_id);
    json.at("modality").get_to(object.modality);
    json.at("series_description").get_to(object.series_description);
    if (const Json& count = json.at("instances"); !count.is_null()) {
      object.instances = count.get<std::uint32_t>();
    }
    if (const Json& failure = json.at("failure"); !failure.is_null()) {
      object.failure = failure.get<std::uint16_t>();
    }
  }
  return objects;
}

PeersAnswer answer_from(const Json& json) {
  return {.objects = objects_from(json.at("objects")),
          .stored = objects_from(json.at("stored")),
          .failed = objects_from(json.at("failed"))};
}

// A format's name is checked before it goes into the log, because the process that sent it reads
// untrusted files.
std::string word_of(const std::string& text) {
  constexpr std::size_t kLongest = 16;
  const bool plain = text.size() <= kLongest && std::ranges::all_of(text, [](char c) {
                       return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
                     });
  if (!plain) throw_malformed();
  return text;
}

void add_line(ImportReport& report, const Json& json) {
  if (json.contains(kBegun)) report.begun = true;
  if (json.contains(kReading)) report.reading = word_of(json.at(kReading).get<std::string>());
  if (json.contains(kVolume)) report.volume = volume_from_json(json.at(kVolume).dump());
  if (json.contains(kAnswer)) report.answer = answer_from(json.at(kAnswer));
  if (json.contains(kError)) report.error = error_from(json.at(kError));
}

}  // namespace

std::string to_message(const ImportOrder& order) {
  const ImportTask& task = order.task;
  const Json json = {
      {"source", task.source.string()},
      {"scratch", task.scratch.string()},
      {"target", task.target.string()},
      {"options", to_json(task.options)},
      {"max_sample_bytes", task.limits.max_sample_bytes},
      {"bounds", to_json(order.bounds)},
  };
  return json.dump();
}

std::string to_message(const AnswerOrder& order) {
  return Json{{"answer", order.task.source.string()}, {"bounds", to_json(order.bounds)}}.dump();
}

std::variant<ImportOrder, AnswerOrder> order_from(std::string_view message) {
  try {
    const Json json = Json::parse(message);
    const ImportBounds bounds = bounds_from(json.at("bounds"));
    if (json.contains(kAnswer)) {
      return AnswerOrder{.task = {json.at(kAnswer).get<std::string>()}, .bounds = bounds};
    }
    ImportOrder order;
    order.task.source = json.at("source").get<std::string>();
    order.task.scratch = json.at("scratch").get<std::string>();
    order.task.target = json.at("target").get<std::string>();
    order.task.options = options_from(json.at("options"));
    json.at("max_sample_bytes").get_to(order.task.limits.max_sample_bytes);
    order.bounds = bounds;
    return order;
  } catch (const Json::exception&) {
    throw_malformed();
  }
}

std::string begun_message() { return line_of(kBegun, true); }

std::string reading_message(std::string_view format) {
  return line_of(kReading, std::string(format));
}

std::string volume_message(const Volume& volume) {
  return line_of(kVolume, Json::parse(to_record(volume)));
}

std::string answer_message(const PeersAnswer& answer) {
  return line_of(kAnswer, {{"objects", to_json(answer.objects)},
                           {"stored", to_json(answer.stored)},
                           {"failed", to_json(answer.failed)}});
}

std::string error_message(const Error& error) { return line_of(kError, to_json(error)); }

ImportReport report_from(std::string_view messages) {
  ImportReport report;
  try {
    for (std::size_t next = 0;;) {
      const std::size_t end = messages.find('\n', next);
      if (end == std::string_view::npos) return report;
      add_line(report, Json::parse(messages.substr(next, end - next)));
      next = end + 1;
    }
  } catch (const Json::exception&) {
    throw_malformed();
  }
}

}  // namespace isomesh::process
