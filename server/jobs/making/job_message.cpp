#include "server/jobs/making/job_message.h"

#include "server/process/message.h"

namespace isomesh::jobs {

using process::ReadLine;

constexpr JobOrder::Work last_of(JobOrder::Work /*value*/) { return JobOrder::Work::kCount; }

void visit(Is<JobSetup> auto& self, auto&& field) {
  field("threads", self.threads);
  field("memory_bytes", self.memory_bytes);
  field("scratch", self.scratch);
}

void visit(Is<JobOrder> auto& self, auto&& field) {
  field("work", self.work);
  field("samples", self.volume.samples);
  field("notes", self.volume.notes);
  field("parameters", self.parameters);
  field("iso", self.iso);
  field("certify", self.measures.certify);
  field("min_thickness_mm", self.measures.min_thickness_mm);
  field("memory_bytes", self.memory_bytes);
  field("disk_bytes", self.disk_bytes);
  field("expected", self.expected);
}

void visit(Is<JobProgress> auto& self, auto&& field) {
  field("stage", self.stage);
  field("share", self.share);
  field("timing", self.timing);
}

void visit(Is<JobPiece> auto& self, auto&& field) {
  field("file", self.file);
  field("bytes", self.bytes);
}

void visit(Is<MadeMesh> auto& self, auto&& field) {
  field("summary", self.summary);
  field("timing", self.timing);
}

void visit(Is<CountedSurface> auto& self, auto&& field) {
  field("triangles", self.size.triangles);
  field("vertices", self.size.vertices);
  field("layers", self.size.layers);
  field("largest_runs", self.size.largest_runs);
  field("labels", self.labels);
  field("searching_bytes", self.searching_bytes);
}

namespace {

constexpr const char* kSetup = "setup";
constexpr const char* kOrder = "order";
constexpr const char* kCancel = "cancel";
constexpr const char* kProgress = "progress";
constexpr const char* kPiece = "piece";
constexpr const char* kMade = "made";
constexpr const char* kCounted = "counted";
constexpr const char* kError = "error";

std::string line_for(const JobProgress& progress) { return process::line_of(kProgress, progress); }
std::string line_for(const JobPiece& piece) { return process::line_of(kPiece, piece); }
std::string line_for(const MadeMesh& made) { return process::line_of(kMade, made); }
std::string line_for(const CountedSurface& counted) { return process::line_of(kCounted, counted); }
std::string line_for(const Error& error) { return process::line_of(kError, error); }

}  // namespace

std::string to_line(const JobSetup& setup) { return process::line_of(kSetup, setup); }
std::string to_line(const JobOrder& order) { return process::line_of(kOrder, order); }

std::string to_line(const JobAnswer& answer) {
  return std::visit([](const auto& one) { return line_for(one); }, answer);
}

JobSetup setup_from(std::string_view line) {
  if (const auto setup = ReadLine(line).find<JobSetup>(kSetup)) return *setup;
  process::throw_malformed();
}

std::optional<JobOrder> order_from(std::string_view line) {
  const ReadLine message(line);
  if (message.find<bool>(kCancel)) return std::nullopt;
  auto order = message.find<JobOrder>(kOrder);
  if (!order) process::throw_malformed();
  return order;
}

JobAnswer answer_from(std::string_view line) {
  const ReadLine message(line);
  if (const auto piece = message.find<JobPiece>(kPiece)) return *piece;
  if (const auto progress = message.find<JobProgress>(kProgress)) return *progress;
  if (auto made = message.find<MadeMesh>(kMade)) return *std::move(made);
  if (auto counted = message.find<CountedSurface>(kCounted)) return *std::move(counted);
  if (const auto problem = message.find<Problem>(kError)) return to_error(*problem);
  process::throw_malformed();
}

}  // namespace isomesh::jobs
