#include <string>
#include <vector>

#include "tests/bench/draco_call.h"
#include "tests/bench/numbers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/report_text.h"
#include "tests/bench/service.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr int kRuns = 9;

}  // namespace

void write_service(const ServicePlan& plan, Report& report) {
  say("service");
  report.document.heading("What a user gets");
  report.document.paragraph(
      "A daemon of one worker, measured over HTTP by the C++ client, beside the peers in the same "
      "run: "
      "`isomesh-bench service`. A job's times are those that it reports, from the samples on the "
      "disk to "
      "the file on the disk; the daemon is warm, and no mesh is taken from an earlier job. The "
      "peers have "
      "their samples in memory and write no file.");
  write_table(measure_service(plan), report.document);
}

void write_draco_share(const Subject& subject, Report& report) {
  say("Draco's share");
  Stages stages(subject.samples, {.iso = subject.levels.front().iso});
  const double extract = median_ms({[&] { stages.extract(); }}, kRuns);
  const double smooth =
      median_ms({[&] { stages.smooth(kPasses); }, [&] { stages.extract(); }}, kRuns);
  const double libdraco = median_ms(
      {[&] { encode_in_one_call(stages.positions(), stages.triangles(), DracoParameters{}); }},
      kRuns);
  const double stream = median_ms({[&] { stages.encode(Encoding::kEdgebreakerWhole); }}, kRuns);
  const double blocks = median_ms({[&] { stages.encode(Encoding::kEdgebreakerChunks); }}, kRuns);
  report.document.heading("Draco's share");
  report.document.paragraph("Extraction, " + std::to_string(kPasses) +
                            " passes and one encoding of `" + subject.samples.name + "` at " +
                            subject.levels.front().name + ", " +
                            std::to_string(stages.size().triangles) +
                            " triangles. With libdraco, which encodes a mesh on one thread, nearly "
                            "all of a job was encoding. "
                            "The encoder of isomesh's own finds neighbours by the layers of the "
                            "mesh instead of by hashing, walks "
                            "over compact arrays, makes both of the format's two traversals at the "
                            "same time, and predicts and "
                            "counts beside them; the streams are Draco's own format.");
  std::vector<std::vector<std::string>> rows;
  const auto add = [&](const std::string& name, double encode) {
    const double whole = extract + smooth + encode;
    rows.push_back({name, milliseconds(extract), milliseconds(smooth), milliseconds(encode),
                    milliseconds(whole), percent(encode / whole)});
  };
  add("libdraco, one stream", libdraco);
  add("isomesh, one stream (`drc`)", stream);
  add("isomesh, blocks (`glb`)", blocks);
  report.document.table({"encoder", "extraction", "smoothing", "encoding", "all", "Draco's share"},
                        rows);
}

}  // namespace isomesh::bench
