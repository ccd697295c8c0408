// isomesh-bench: times every stage and, where VTK was found when it was built, VTK's on the same
// volume in the same run.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <regex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "server/jobs/making/memory.h"
#include "tests/bench/accuracy.h"
#include "tests/bench/budget.h"
#include "tests/bench/cluster.h"
#include "tests/bench/findings.h"
#include "tests/bench/imports.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/label_table.h"
#include "tests/bench/labels.h"
#include "tests/bench/lattices.h"
#include "tests/bench/machine.h"
#include "tests/bench/memory.h"
#include "tests/bench/peers.h"
#include "tests/bench/ratios.h"
#include "tests/bench/service.h"
#include "tests/bench/stage_table.h"
#include "tests/bench/stages.h"
#include "tests/bench/surface_nets.h"

namespace isomesh::bench {
namespace {

constexpr const char* kDefaultVolume = "/usr/share/mricron/templates/ch2.nii.gz";
constexpr double kDefaultIso = 60;

struct Options {
  std::filesystem::path volume;
  std::optional<double> iso;
  int threads = 0;  // 0: one and two
  std::vector<std::uint32_t> sizes = {64, 128, 256, 512};
  bool json = false;
  std::string filter = ".";
  std::filesystem::path surface_nets_root;
};

// The real volume into the plan; a default one that is not installed is left out, saying so.
void load(const Options& options, Plan& plan) {
  const bool is_default = options.volume.empty();
  const std::filesystem::path path = is_default ? kDefaultVolume : options.volume;
  if (is_default && !std::filesystem::exists(path)) {
    std::cerr << "isomesh-bench: " << path.string()
              << " is not there (Debian's package mricron-data); only the synthetic field is "
                 "measured\n";
    return;
  }
  LoadedVolume loaded = load_volume(path);
  plan.iso = options.iso.value_or(is_default ? kDefaultIso : loaded.suggested_iso);
  if (Stages(loaded.samples, {.iso = plan.iso}).count().triangles == 0) {
    throw std::runtime_error("there is no surface at iso-value " + std::to_string(plan.iso));
  }
  plan.volume = std::move(loaded.samples);
}

std::vector<int> thread_counts(const Options& options) {
  return options.threads > 0 ? std::vector{options.threads} : std::vector{1, 2};
}

Plan plan_of(const Options& options) {
  Plan plan;
  plan.filter = options.filter;
  plan.field_sizes = options.sizes;
  std::ranges::sort(plan.field_sizes);
  plan.threads = thread_counts(options);
  load(options, plan);
  return plan;
}

std::string missing_peers() { return peers_available() ? "" : peers_description() + '\n'; }

// Prints tables one by one in Markdown, or all of them as one JSON document at the end.
class Output {
 public:
  explicit Output(bool json) : json_(json) {}

  void add(const std::string& heading, const std::vector<Finding>& findings,
           const std::string& about = {}) {
    add(heading, to_json(findings), about);
  }
  void add(const std::string& heading, const Json& rows, const std::string& about = {}) {
    document_[heading] = rows;
    if (json_ || rows.empty()) return;
    std::cout << "## " << heading << "\n\n";
    if (!about.empty()) std::cout << about << "\n\n";
    std::cout << to_markdown(rows) << std::endl;
  }

  void end(const std::string& notes = missing_peers()) {
    document_["peers"] = {{"available", peers_available()}, {"description", peers_description()}};
    if (json_) std::cout << document_.dump(2) << '\n';
    std::cerr << notes;
  }

 private:
  const bool json_;
  Json document_;
};

int run(const Options& options) {
  const Plan plan = plan_of(options);
  Output output(options.json);
  output.add("Machine", describe_machine());
  output.add("Stages", measure_stages(plan));
  output.add("Ratios", measure_ratios(plan));
  output.end();
  return 0;
}

// Of a ball, and of the real volume.
Json lattices_of(const Plan& plan) {
  set_threads(plan.threads.back());
  Json rows = measure_lattices(ball(), kBallIso);
  if (!plan.volume) return rows;
  for (const Json& row : measure_lattices(*plan.volume, plan.iso)) rows.push_back(row);
  return rows;
}

int run_lattices(const Options& options) {
  const Plan plan = plan_of(options);
  Output output(options.json);
  output.add("Lattices and smoothings", lattices_of(plan));
  output.end();
  return 0;
}

int run_imports(const Options& options) {
  Output output(options.json);
  output.add("Imports by order of axes", measure_imports());
  output.end();
  return 0;
}

int run_budget(const Options& options) {
  const Json rows = measure_budget();
  Output output(options.json);
  output.add("Budget", rows);
  output.end("");
  return std::ranges::all_of(rows, [](const Json& row) { return row.at("within"); }) ? 0 : 1;
}

std::filesystem::path daemon_beside_this() {
  return std::filesystem::read_symlink("/proc/self/exe").parent_path() / "isomeshd";
}

std::vector<Finding> service_findings(const Options& options, const std::filesystem::path& daemon) {
  ServicePlan plan = {.daemon = daemon,
                      .volume = options.volume.empty() ? kDefaultVolume : options.volume,
                      .iso = options.iso.value_or(kDefaultIso),
                      .threads = options.threads};
  if (!options.volume.empty() && !options.iso) plan.iso = load_volume(plan.volume).suggested_iso;
  return measure_service(plan);
}

int run_service(const Options& options, const std::filesystem::path& daemon) {
  Output output(options.json);
  output.add("Service", service_findings(options, daemon));
  output.end();
  return 0;
}

int run_cluster(const Options& options, const std::filesystem::path& daemon) {
  Output output(options.json);
  output.add("Cluster", measure_cluster(daemon));
  output.end("");
  return 0;
}

std::string count_of(int threads) {
  return std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

// The tables of `isomesh-bench labels`.
constexpr std::array kLabelTables = {"times", "shapes", "volumes"};

int run_labels(const Options& options, std::uint32_t body_samples,
               const std::vector<std::string>& tables) {
  const auto has = [&](const char* table) {
    return tables.empty() || std::ranges::find(tables, table) != tables.end();
  };
  const std::vector<Samples> all = options.volume.empty()
                                       ? segmentations(body_samples)
                                       : std::vector{load_labels(options.volume)};
  Output output(options.json);
  const std::vector<int> counts = thread_counts(options);
  for (const int count : counts) {
    for (const Samples& samples : all) {
      if (!has("times")) continue;
      output.add(samples.name + ", " + count_of(count),
                 measure_label_findings(samples, {count, options.surface_nets_root}));
    }
  }
  set_threads(counts.back());
  if (has("shapes")) output.add("shapes", shape_table());
  if (has("volumes")) output.add("volumes of labels over 1 000 voxels", volume_table(all));
  const bool without_nets = options.surface_nets_root.empty();
  output.end(missing_peers() + (without_nets ? kNoSurfaceNets + std::string("\n") : ""));
  return 0;
}

// The real volume; if there is none, the synthetic field of the first size.
int run_accuracy(const Options& options, AccuracyPlan plan, bool only_certify) {
  Plan loaded;
  load(options, loaded);
  const Samples samples =
      loaded.volume ? std::move(*loaded.volume) : synthetic_field(options.sizes.front());
  plan.iso = loaded.volume ? loaded.iso : kFieldIso;
  Output output(options.json);
  for (const int threads : thread_counts(options)) {
    plan.threads = threads;
    if (only_certify) {
      output.add(count_of(threads), measure_certify(samples, plan));
      output.add("labels of 20^3 samples, " + count_of(threads), measure_uneven(threads));
      continue;
    }
    if (threads < 2 && options.threads == 0) continue;  // each run takes minutes
    output.add(count_of(threads), measure_approximations(samples, plan));
  }
  output.end();
  return 0;
}

int run_report(const Options& options, const std::filesystem::path& daemon) {
  const Plan plan = plan_of(options);
  if (!options.json) std::cout << "# What `isomesh-bench report` measured\n\n";
  Output output(options.json);
  output.add("Machine", describe_machine());
  output.add(
      "What a user gets", service_findings(options, daemon),
      "A daemon of one worker, measured over HTTP by the C++ client, beside the peers in the "
      "same run. A job's times are those that it reports, from the samples on the disk to "
      "the file on the disk. The peers have their samples in memory and write no file.");
  output.add("Against the peers and the goals", measure_ratios(plan),
             "The kernels and a job's way through them in one process, without the service. Ratios "
             "are medians over pairs of runs, ours and the peer's in turn.");
  output.add("Lattices and smoothings", lattices_of(plan),
             "Surfaces are closed where they meet the volume's border. *ms* is the time of "
             "extraction where nothing is smoothed, otherwise that of smoothing. *distance_steps* "
             "is the largest distance of a vertex or a centre of a triangle from the extracted "
             "surface.");
  output.add(
      "Time and memory against size", measure_growth(plan),
      "A field whose surface grows with n^2; six tetrahedra, five passes. Memory is the peak "
      "of a process of its own that holds the samples and runs the stage once; *least* is "
      "samples + mesh.");
  if (plan.volume) {
    output.add(
        "One number for the error",
        measure_approximations(*plan.volume, {.iso = plan.iso, .threads = plan.threads.back()}),
        "Jobs to drc of five passes. *Scan* is the surface as it was extracted. The peers "
        "have the smoothed surface in memory and make as many triangles of it; they know no "
        "bound.");
  }
  output.end();
  return 0;
}

std::string check_filter(const std::string& text) {
  try {
    const std::regex filter(text);
    return {};
  } catch (const std::regex_error&) {
    return "is not a regular expression";
  }
}

// Parses and runs; the exit status.
int run_program(int argc, char** argv) {
  Options options;
  CLI::App app("Times the stages of isomesh, beside VTK's where it was built with VTK.",
               "isomesh-bench");
  app.add_option("--volume", options.volume, "A volume file in any format that isomesh imports")
      ->check(CLI::ExistingFile);
  app.add_option("--iso", options.iso, "Its iso-value; Otsu's threshold unless given");
  app.add_option("--threads", options.threads, "Only this number of threads, instead of 1 and 2")
      ->check(CLI::Range(1, 1024));
  app.add_option("--size", options.sizes, "Sizes of the synthetic field")
      ->check(CLI::Range(8, 2048));
  app.add_option("--filter", options.filter, "Only what has a name that this expression matches")
      ->check(check_filter);
  app.add_flag("--json", options.json, "One JSON document instead of text");

  app.add_option("--surface-nets-root", options.surface_nets_root,
                 "For `labels`: the folder of a Debian 13 with python3-vtk9 and "
                 "python3-numpy, as debootstrap makes it, whose vtkSurfaceNets3D is a peer; left "
                 "out without it")
      ->envname("ISOMESH_SURFACE_NETS_ROOT")
      ->check(CLI::ExistingDirectory);

  std::filesystem::path daemon = daemon_beside_this();
  CLI::App* service =
      app.add_subcommand("service", "Start a daemon and measure it over HTTP, beside the peers");
  service->add_option("--daemon", daemon, "The program; isomeshd beside this one unless given")
      ->check(CLI::ExistingFile);
  service->fallthrough();  // --volume, --iso and --threads may stand behind it

  CLI::App* cluster = app.add_subcommand(
      "cluster", "Start daemons on a PostgreSQL of their own and measure queue and jobs");
  cluster->add_option("--daemon", daemon, "The program; isomeshd beside this one unless given")
      ->check(CLI::ExistingFile);
  cluster->fallthrough();

  CLI::App* report = app.add_subcommand(
      "report", "Print all tables of tests/bench/REPORT.md, one after the other");
  report->fallthrough();
  CLI::App* lattices = app.add_subcommand(
      "lattices",
      "Every lattice, plain and regularised, and every smoothing of a ball and of "
      "--volume: triangles, angles, volume, distance and time");
  lattices->fallthrough();
  CLI::App* imports = app.add_subcommand(
      "imports", "Import a scan whose file has its axes in another order than the patient");
  imports->fallthrough();
  CLI::App* budget = app.add_subcommand(
      "budget", "Fail if a stage takes more than twice its usual share of a plain loop's time");
  budget->fallthrough();

  std::uint32_t samples = 300;
  CLI::App* labels = app.add_subcommand(
      "labels",
      "Separate all labels of --volume, or of a synthetic body and of Debian's atlases, beside the "
      "peers: times; and the areas, volumes and distances of simple shapes");
  labels->add_option("--samples", samples, "Of the synthetic body along each axis")
      ->check(CLI::Range(64, 1024));
  std::vector<std::string> tables;
  labels->add_option("--only", tables, "Tables to measure; several are separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(std::vector<std::string>(kLabelTables.begin(), kLabelTables.end())));
  labels->fallthrough();

  AccuracyPlan accuracy;
  bool only_fast = false;
  CLI::App* simplify = app.add_subcommand(
      "simplify", "Simplify within errors, beside the peers at as many triangles");
  simplify->add_option("--error", accuracy.errors_mm, "Millimetres; several are measured in turn")
      ->check(CLI::PositiveNumber);
  simplify->add_flag("--only-fast", only_fast, "Without the peers that take minutes");
  simplify->fallthrough();
  CLI::App* certify = app.add_subcommand(
      "certify", "Measure how far the smoothed surface is from the extracted one");
  certify->fallthrough();

  std::string stage;
  std::string size_or_file;
  int threads = 1;
  CLI::App* memory = app.add_subcommand(kMemoryCommand, "")->group("");
  memory->add_option("stage", stage)->required();
  memory->add_option("size-or-file", size_or_file)->required();
  memory->add_option("threads", threads)->required();

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    constexpr int kWrongUsage = 2;
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  if (*memory) return run_memory_command(stage, size_or_file, threads);
  if (*budget) return run_budget(options);
  warn_when_busy();
  if (*imports) return run_imports(options);
  if (*service) return run_service(options, daemon);
  if (*cluster) return run_cluster(options, daemon);
  accuracy.with_peers = !only_fast;
  if (*simplify || *certify) return run_accuracy(options, accuracy, bool(*certify));
  if (*labels) return run_labels(options, samples, tables);
  if (*lattices) return run_lattices(options);
  return *report ? run_report(options, daemon) : run(options);
}

}  // namespace
}  // namespace isomesh::bench

int main(int argc, char** argv) {
  try {
    // As the daemon does; the peers run in the same process and have it too.
    isomesh::jobs::keep_freed_memory();
    return isomesh::bench::run_program(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "isomesh-bench: " << error.what() << '\n';
    return 1;
  }
}
