#include "tests/bench/report.h"

#include <algorithm>
#include <array>
#include <iostream>
#include <optional>

#include "tests/bench/ct_head.h"
#include "tests/bench/machine.h"
#include "tests/bench/peers.h"
#include "tests/bench/report_sections.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {
namespace {

constexpr const char* kBrainFile = "/usr/share/mricron/templates/ch2.nii.gz";
constexpr double kBrainIso = 60;
constexpr std::uint32_t kPaperSize = 128;
constexpr std::array kSizes = {64U, 96U, 128U, 192U, 256U, 384U, 512U};

std::optional<Subject> ct_head() {
  if (!std::filesystem::exists(kCtHeadFile)) return std::nullopt;
  return Subject{read_inv3(kCtHeadFile),
                 {{"skin at " + std::to_string(static_cast<int>(kSkinIso)) + " HU", kSkinIso},
                  {"bone at " + std::to_string(static_cast<int>(kBoneIso)) + " HU", kBoneIso}}};
}

std::optional<Subject> brain() {
  if (!std::filesystem::exists(kBrainFile)) return std::nullopt;
  Subject subject{load_volume(kBrainFile).samples, {{"iso 60", kBrainIso}}};
  subject.samples.name = "ch2";
  return subject;
}

void write_opening(const std::optional<Subject>& head, const std::optional<Subject>& brain,
                   int threads, Document& document) {
  document.heading("The paper, measured again");
  document.paragraph(
      "Written by `isomesh-bench report`. It reproduces Tables 2 and 3 and Figures 4, 5 and 6 of "
      "\"Laplacian mesh smoothing for tetrahedra based volume visualization\" on this machine, "
      "beside the paper's own way of doing it, built again as it describes it, and VTK. Times are "
      "medians of several runs on " +
      std::to_string(threads) +
      " threads, with memory that was used before, unless said otherwise. Ratios hold better than "
      "times: other machines and busier days give other times.");
  std::vector<std::vector<std::string>> rows;
  for (const auto& [key, value] : describe_machine()) rows.push_back({key, value});
  document.table({"machine", ""}, rows);
  std::vector<std::string> volumes;
  volumes.push_back(head ? "`ct-head`: CT of a head, 256x256x108 int16, from Debian's package "
                           "invesalius-examples, resampled (trilinear) to cubes"
                         : "The CT of a head is missing: Debian's package invesalius-examples is "
                           "not installed. What needs it is left out");
  volumes.push_back(brain ? "`ch2`: MRI of a brain, 181x217x181 uint8, from Debian's package "
                            "mricron-data"
                          : "The MRI of a brain is missing: Debian's package mricron-data is not "
                            "installed. What needs it is left out");
  document.bullets(volumes);
}

}  // namespace

int write_report(const std::filesystem::path& folder, const std::filesystem::path& daemon,
                 const std::filesystem::path& surface_nets_root,
                 const std::vector<std::string>& only) {
  const auto is_wanted = [&](const char* section) {
    return only.empty() || std::ranges::find(only, section) != only.end();
  };
  const int threads = std::min(2, processors());
  set_threads(threads);
  Peers::set_threads(threads);
  Document document(folder);
  Report report{document, {}, threads};

  const std::optional<Subject> head = ct_head();
  const std::optional<Subject> real = brain();
  write_opening(head, real, threads, document);

  Plan plan;
  plan.threads = {threads};
  plan.field_sizes = {64, 128, 256, 512};
  if (real) {
    plan.volume = real->samples;
    plan.iso = kBrainIso;
  }
  if (real && is_wanted("service")) {
    write_service({daemon, kBrainFile, kBrainIso, threads}, report);
    write_draco_share(*real, report);
  }
  if (is_wanted("cluster")) write_cluster(daemon, report);
  if (is_wanted("goals")) write_goals(plan, report);
  std::vector<Subject> subjects;
  if (head) {
    subjects.push_back(
        {resample(head->samples, {kPaperSize, kPaperSize, kPaperSize}), head->levels});
  }
  if (real) subjects.push_back(*real);
  if (!subjects.empty() && is_wanted("paper")) write_table_2(subjects, report);
  if (head && is_wanted("paper")) {
    write_table_3(*head, report);
    write_figure_4(*head, report);
    write_figures_5_and_6(*head, report);
  }
  if (is_wanted("passes")) {
    for (const Subject& subject : subjects) write_passes(subject, report);
  }
  if (is_wanted("growth")) write_growth(kSizes, report);
  if (!subjects.empty() && is_wanted("quality")) {
    write_choices(subjects, report);
    write_quality(subjects, report);
  }
  if (is_wanted("labels")) write_labels(surface_nets_root, report);
  std::vector<AccuracySubject> scans;
  if (real) scans.push_back({real->samples, real->levels.front()});
  if (head) scans.push_back({head->samples, head->levels.back()});
  if (!scans.empty() && is_wanted("accuracy")) write_accuracy(scans, report);
  if (!report.remarks.empty()) {
    document.heading("Where measurement and paper differ");
    document.bullets(report.remarks);
  }
  document.write();
  std::cout << (folder / "REPORT.md").string() << '\n';
  return 0;
}

}  // namespace isomesh::bench
