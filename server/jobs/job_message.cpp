#include "server/jobs/job_message.h"

#include <nlohmann/json.hpp>

#include "proto/json.h"

namespace isomesh::jobs {
namespace {

using Json = nlohmann::json;

[[noreturn]] void throw_malformed() {
  throw Error(ErrorCode::kInternal, "A message between a worker and its process is malformed.");
}

std::string line_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

// Reads a line; what JSON finds wrong with it makes it malformed.
template <class Read>
auto read_line(std::string_view line, const Read& read) {
  try {
    return read(Json::parse(line));
  } catch (const Json::exception&) {
    throw_malformed();
  }
}

Json to_json(const Timing& timing) {
  return {timing.queue, timing.load, timing.extract, timing.smooth, timing.encode, timing.total};
}

Timing timing_from(const Json& json) {
  return {.queue = json.at(0),
          .load = json.at(1),
          .extract = json.at(2),
          .smooth = json.at(3),
          .encode = json.at(4),
          .total = json.at(5)};
}

std::vector<std::string> strings_of(const std::vector<std::filesystem::path>& paths) {
  return {paths.begin(), paths.end()};
}

Error error_of(const Json& json) {
  return {error_code_of(json.at("code").get<std::string>()), json.at("detail").get<std::string>()};
}

}  // namespace

std::string to_line(const JobSetup& setup) {
  return line_of({{"readable", setup.readable.string()},
                  {"writable", setup.writable.string()},
                  {"threads", setup.threads}});
}

std::string to_line(const JobOrder& order) {
  return line_of({{"volume", order.volume.string()},
                  {"job", isomesh::to_json(order.job)},
                  {"iso", order.iso},
                  {"memory_bytes", order.memory_bytes},
                  {"files", strings_of(order.files)}});
}

std::string to_line(const JobProgress& progress) {
  return line_of({{"stage", static_cast<int>(progress.stage)},
                  {"share", progress.share},
                  {"timing", to_json(progress.timing)}});
}

std::string made_line(const Job& job) { return line_of({{"made", isomesh::to_json(job)}}); }

std::string error_line(const Error& error) {
  return line_of({{"code", std::string(describe(error.code()).name)}, {"detail", error.what()}});
}

JobSetup setup_from(std::string_view line) {
  return read_line(line, [](const Json& json) {
    return JobSetup{.readable = json.at("readable").get<std::string>(),
                    .writable = json.at("writable").get<std::string>(),
                    .threads = json.at("threads").get<int>()};
  });
}

std::optional<JobOrder> order_from(std::string_view line) {
  return read_line(line, [](const Json& json) -> std::optional<JobOrder> {
    if (json.contains("cancel")) return std::nullopt;
    JobOrder order = {.volume = json.at("volume").get<std::string>(),
                      .job = job_from_record(json.at("job").get<std::string>()),
                      .iso = json.at("iso").get<double>(),
                      .memory_bytes = json.at("memory_bytes").get<std::uint64_t>(),
                      .files = {}};
    for (const Json& file : json.at("files")) order.files.emplace_back(file.get<std::string>());
    if (order.files.size() != order.job.parameters.formats.size()) throw_malformed();
    return order;
  });
}

JobAnswer answer_from(std::string_view line) {
  return read_line(line, [](const Json& json) {
    JobAnswer answer;
    if (json.contains("made")) answer.made = job_from_record(json.at("made").get<std::string>());
    if (json.contains("code")) answer.error = error_of(json);
    if (json.contains("stage")) {
      const int stage = json.at("stage").get<int>();
      if (stage < 0 || stage > static_cast<int>(Stage::kDone)) throw_malformed();
      answer.progress = {static_cast<Stage>(stage), json.at("share").get<double>(),
                         timing_from(json.at("timing"))};
    }
    if (!answer.made && !answer.error && !answer.progress) throw_malformed();
    return answer;
  });
}

}  // namespace isomesh::jobs
