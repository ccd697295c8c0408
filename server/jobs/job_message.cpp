#include "server/jobs/job_message.h"

#include <vector>

#include <nlohmann/json.hpp>

#include "proto/json.h"

namespace isomesh::jobs {
namespace {

using Json = nlohmann::json;

[[noreturn]] void throw_malformed() {
  throw Error(ErrorCode::kInternal, "A message between the daemon and a job is malformed.");
}

// Stands before a job's record, where a line has one. Within JSON it is always escaped.
constexpr char kBeforeRecord = '\t';

std::string line_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

// The record as it is: within the other JSON it would be escaped, and read twice.
std::string line_of(const Json& json, const Job& job) {
  std::string line = line_of(json);
  line.back() = kBeforeRecord;
  return line + isomesh::to_json(job) + '\n';
}

// Reads a line; what JSON finds wrong with it makes it malformed.
template <class Read>
auto read_line(std::string_view line, const Read& read) {
  try {
    return read(Json::parse(line.substr(0, line.find(kBeforeRecord))));
  } catch (const Json::exception&) {
    throw_malformed();
  }
}

Job record_of(std::string_view line) {
  const std::size_t before = line.find(kBeforeRecord);
  if (before == std::string_view::npos) throw_malformed();
  return job_from_record(line.substr(before + 1));
}

Json json_of(const std::vector<Note>& notes) {
  Json json = Json::array();
  for (const Note& note : notes) json.push_back({note.code, note.detail});
  return json;
}

std::vector<Note> notes_from(const Json& json) {
  std::vector<Note> notes;
  for (const Json& note : json) {
    notes.push_back({note.at(0).get<std::string>(), note.at(1).get<std::string>()});
  }
  return notes;
}

// Parameters and summaries have a form as parts of a job.
Job job_with(const MeshParameters& parameters) {
  Job job;
  static_cast<MeshParameters&>(job.parameters) = parameters;
  return job;
}

Job job_with(const MeshSummary& summary) {
  Job job;
  job.mesh = summary;
  return job;
}

Json json_of(const Timing& timing) {
  return {timing.queue,    timing.load,   timing.extract, timing.smooth,
          timing.simplify, timing.encode, timing.certify, timing.total};
}

Timing timing_from(const Json& json) {
  return {.queue = json.at(0),
          .load = json.at(1),
          .extract = json.at(2),
          .smooth = json.at(3),
          .simplify = json.at(4),
          .encode = json.at(5),
          .certify = json.at(6),
          .total = json.at(7)};
}

Json json_of(const JobProgress& progress) {
  return {{"stage", static_cast<int>(progress.stage)},
          {"share", progress.share},
          {"timing", json_of(progress.timing)}};
}

Json json_of(const JobPiece& piece) { return {{"file", piece.file}, {"bytes", piece.bytes}}; }

Json json_of(const CountedSurface& counted) {
  const auto& [triangles, vertices, layers, largest_layer] = counted.size;
  Json labels = Json::array();
  for (const auto& [label, count] : counted.labels) labels.push_back({label, count});
  return {{"counted", {triangles, vertices, layers, largest_layer}}, {"labels", labels}};
}

Json json_of(const Error& error) {
  return {{"code", std::string(describe(error.code()).name)}, {"detail", error.what()}};
}

std::string line_for(const auto& answer) { return line_of(json_of(answer)); }

std::string line_for(const MadeMesh& made) {
  return line_of({{"made", json_of(made.timing)}}, job_with(made.summary));
}

JobProgress progress_from(const Json& json) {
  const int stage = json.at("stage").get<int>();
  if (stage < 0 || stage > static_cast<int>(Stage::kDone)) throw_malformed();
  return {static_cast<Stage>(stage), json.at("share").get<double>(),
          timing_from(json.at("timing"))};
}

MadeMesh made_from(const Json& json, const Job& job) {
  if (!job.mesh) throw_malformed();
  return {*job.mesh, timing_from(json.at("made"))};
}

CountedSurface counted_from(const Json& json) {
  const Json& size = json.at("counted");
  CountedSurface counted = {.size = {.triangles = size.at(0),
                                     .vertices = size.at(1),
                                     .layers = size.at(2),
                                     .largest_layer = size.at(3)}};
  for (const Json& label : json.at("labels")) counted.labels.push_back({label.at(0), label.at(1)});
  return counted;
}

Error error_from(const Json& json) {
  return {error_code_of(json.at("code").get<std::string>()), json.at("detail").get<std::string>()};
}

}  // namespace

std::string to_line(const JobSetup& setup) { return line_of({{"threads", setup.threads}}); }

std::string to_line(const JobOrder& order) {
  return line_of({{"work", static_cast<int>(order.work)},
                  {"volume", order.volume.id},
                  {"notes", json_of(order.volume.notes)},
                  {"iso", order.iso},
                  {"certify", order.certify},
                  {"memory_bytes", order.memory_bytes},
                  {"disk_bytes", order.disk_bytes}},
                 job_with(order.parameters));
}

std::string to_line(const JobAnswer& answer) {
  return std::visit([](const auto& one) { return line_for(one); }, answer);
}

JobSetup setup_from(std::string_view line) {
  return read_line(
      line, [](const Json& json) { return JobSetup{.threads = json.at("threads").get<int>()}; });
}

std::optional<JobOrder> order_from(std::string_view line) {
  return read_line(line, [&](const Json& json) -> std::optional<JobOrder> {
    if (json.contains("cancel")) return std::nullopt;
    JobOrder order = {.work = static_cast<JobOrder::Work>(json.at("work").get<int>()),
                      .file = {},
                      .volume = {},
                      .parameters = record_of(line).parameters,
                      .iso = json.at("iso").get<double>(),
                      .certify = json.at("certify").get<bool>(),
                      .memory_bytes = json.at("memory_bytes").get<std::uint64_t>(),
                      .disk_bytes = json.at("disk_bytes").get<std::uint64_t>()};
    order.volume.id = json.at("volume").get<std::string>();
    order.volume.notes = notes_from(json.at("notes"));
    return order;
  });
}

JobAnswer answer_from(std::string_view line) {
  return read_line(line, [&](const Json& json) -> JobAnswer {
    if (json.contains("stage")) return progress_from(json);
    if (json.contains("file")) return JobPiece{json.at("file"), json.at("bytes")};
    if (json.contains("made")) return made_from(json, record_of(line));
    if (json.contains("counted")) return counted_from(json);
    if (json.contains("code")) return error_from(json);
    throw_malformed();
  });
}

}  // namespace isomesh::jobs
