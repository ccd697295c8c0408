// The parts of isomesh-bench that its figures rest on.
#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <zlib.h>

#include "server/mesh/labels/labels.h"
#include "tests/bench/ct_head.h"
#include "tests/bench/label_body.h"
#include "tests/bench/paper.h"
#include "tests/bench/ratios.h"
#include "tests/bench/report.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"
#include "tests/bench/timing.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::bench {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr Surface kSurface = {.iso = kFieldIso};

class PaperWay : public testing::TestWithParam<Scheme> {};

TEST_P(PaperWay, FindsTheVerticesThatTheKernelsNumber) {
  const Samples field = synthetic_field(24);
  for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
    const Surface surface = {kFieldIso, GetParam(), way};
    Stages stages(field, surface);
    stages.extract();
    const Soup soup = extract_soup(field, surface);
    EXPECT_EQ(soup.size(), stages.size().triangles);
    EXPECT_EQ(find_unique(soup, 7).vertices.size(), stages.size().vertices);
  }
}

INSTANTIATE_TEST_SUITE_P(Schemes, PaperWay, testing::Values(Scheme::kFive, Scheme::kSix));

TEST(PaperWay, SmoothsLikeTheKernelsWithAnyNumberOfSubTables) {
  constexpr int kPasses = 3;
  const Samples field = synthetic_field(16);
  Stages stages(field, kSurface);
  stages.extract();
  const Soup soup = soup_of(stages.positions(), stages.triangles());
  stages.smooth(kPasses);
  for (const std::size_t sub_tables : {1, 3, 1000}) {
    IndexedMesh mesh = find_unique(soup, sub_tables);
    smooth(find_neighbors(mesh), kPasses, mesh);
    ASSERT_EQ(mesh.triangles.size(), stages.triangles().size());
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const mesh::Vec3& theirs = mesh.vertices[mesh.triangles[t][corner]];
        const mesh::Vec3& ours = stages.positions()[stages.triangles()[t][corner]];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          ASSERT_NEAR(theirs[axis], ours[axis], 1e-4) << sub_tables << " tables, triangle " << t;
        }
      }
    }
  }
}

TEST(Resample, KeepsALinearFieldAndItsBox) {
  Samples samples;
  samples.type = SampleType::kInt16;
  samples.dims = {5, 4, 3};
  samples.geometry.spacing = {1, 2, 3};
  std::vector<std::int16_t> values;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 5; ++i) {
        values.push_back(static_cast<std::int16_t>(100 * i + 10 * j - 7 * k));
      }
    }
  }
  const auto bytes = std::as_bytes(std::span(values));
  samples.bytes.assign(bytes.begin(), bytes.end());

  const Samples fine = resample(samples, {9, 7, 5});
  EXPECT_EQ(fine.geometry.spacing, (std::array<double, 3>{0.5, 1, 1.5}));
  for (std::size_t k = 0; k < 5; ++k) {
    for (std::size_t j = 0; j < 7; ++j) {
      for (std::size_t i = 0; i < 9; ++i) {
        const double expected = 50.0 * static_cast<double>(i) + 5.0 * static_cast<double>(j) -
                                3.5 * static_cast<double>(k);
        EXPECT_NEAR(fine.as<float>()[(k * 7 + j) * 9 + i], expected, 1e-3);
      }
    }
  }
}

TEST(Timing, MedianAndSlope) {
  EXPECT_EQ(median({3, 1, 2}), 2);
  EXPECT_EQ(median({4, 1, 2, 3}), 2.5);
  EXPECT_NEAR(log_log_slope({{1, 5}, {10, 50}, {100, 500}}), 1, 1e-9);
  EXPECT_NEAR(log_log_slope({{1, 1}, {4, 2}, {16, 4}}), 0.5, 1e-9);
}

TEST(Timing, PairsPrepareUntimedAndRunEquallyOften) {
  int ours = 0;
  int peers = 0;
  int prepared = 0;
  time_in_pairs({[&] { ++ours; }, [&] { ++prepared; }}, {[&] { ++peers; }}, 4);
  EXPECT_EQ(ours, 5);
  EXPECT_EQ(peers, 5);
  EXPECT_EQ(prepared, 5);
}

TEST(LabelBody, HasAllItsLabels) {
  const Samples body = label_body(64);
  const mesh::Lattice<std::uint8_t> lattice = {body.as<std::uint8_t>(), body.dims, {}};
  const auto labels = mesh::count_labels(lattice, {});
  ASSERT_EQ(labels.size(), kBodyLabels + 1);
  EXPECT_EQ(labels.front().label, 0);
  EXPECT_EQ(labels.back().label, static_cast<std::int64_t>(kBodyLabels));
}

TEST(Report, IsWrittenFromWhatIsMeasured) {
  ReportPlan plan;
  plan.sections = {"paper", "passes", "quality", "lattices", "accuracy"};
  plan.head = Subject{synthetic_field(24), {{"skin", kFieldIso}, {"bone", kFieldIso + 1}}};
  plan.cubes = {12, 20};
  plan.paper_triangles = {20'000, 8'000};
  Json measured = measure_report(plan);
  measured["goals"] = to_json({{"ratio/one", "one thing", "2 ms", "4 ms", 0.5, Goal{0.4}}});
  const Json small = {{"size", 8},          {"samples", 512},     {"triangles", 100},
                      {"extract_ms", 1},    {"smooth_ms", 2},     {"job_ms", 3},
                      {"least_bytes", 600}, {"extract_bytes", 1}, {"smooth_bytes", Json()},
                      {"job_bytes", 3}};
  Json large = small;
  large["samples"] = 4096;
  measured["growth"] = {small, large};
  const test::TemporaryFolder folder;
  test::write_file(folder / "report.json", measured.dump());

  const test::Finished finished = test::run({ISOMESH_REPORT_SCRIPT, folder / "report.json"});
  ASSERT_EQ(finished.status, 0) << finished.errors;
  const std::string text = test::read_file(folder / "REPORT.md");
  EXPECT_THAT(text, HasSubstr("| one thing | 2 ms | 4 ms | 0.50 | at most 0.40 | not reached |"));
  EXPECT_THAT(text, HasSubstr("| field-24 20x20x20, skin | 5 tetrahedra |"));
  EXPECT_THAT(text, HasSubstr("| bcc (body-centred), regularised | optimize, 5 passes | "));
  EXPECT_THAT(text, HasSubstr("| E = 0.50 mm |"));
  EXPECT_THAT(text, HasSubstr("| 8^3 | 0.0 MiB | 0.0 MiB | - | 0.0 MiB |"));
  EXPECT_THAT(text, HasSubstr("`ch2` is missing"));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
  for (const char* figure : {"sub-tables", "time-against-size", "memory-against-size",
                             "passes-field-24-20x20x20-skin", "error-field-24-24x24x24-bone"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / (figure + std::string(".svg")))) << figure;
  }
}

// A project file of 2 x 2 x 3 samples, or only its first `members` members.
class ProjectFile {
 public:
  explicit ProjectFile(int members)
      : path_(testing::TempDir() + "isomesh-bench-" + std::to_string(members) + ".inv3") {
    const gzFile file = gzopen(path_.c_str(), "wb");
    if (members > 0) {
      add(file, "tmp/main.plist",
          "<key>dtype</key><string>int16</string><key>shape</key><array><integer>3</integer>"
          "<integer>2</integer><integer>2</integer></array><key>spacing</key><array>"
          "<real>0.5</real><integer>1</integer><real>1.5</real></array>");
    }
    if (members > 1) add(file, "tmp/matrix.dat", std::string(24, '\1'));
    const std::string end(1024, '\0');
    gzwrite(file, end.data(), static_cast<unsigned>(end.size()));
    gzclose(file);
  }
  ~ProjectFile() { std::filesystem::remove(path_); }
  ProjectFile(const ProjectFile&) = delete;
  ProjectFile& operator=(const ProjectFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  static void add(gzFile file, const std::string& name, const std::string& content) {
    std::string header(512, '\0');
    header.replace(0, name.size(), name);
    char size[12];
    std::snprintf(size, sizeof size, "%011o", static_cast<unsigned>(content.size()));
    header.replace(124, 11, size);
    std::string block = header + content;
    block.resize((block.size() + 511) / 512 * 512);
    gzwrite(file, block.data(), static_cast<unsigned>(block.size()));
  }

  std::string path_;
};

TEST(CtHead, ReadsAProjectFile) {
  const ProjectFile file(2);
  const Samples samples = read_inv3(file.path());
  EXPECT_EQ(samples.dims.x, 2U);
  EXPECT_EQ(samples.dims.z, 3U);
  EXPECT_EQ(samples.geometry.spacing, (std::array<double, 3>{0.5, 1, 1.5}));
  EXPECT_EQ(samples.as<std::int16_t>()[11], 0x0101);
}

TEST(CtHead, RefusesAFileWithoutSamples) {
  EXPECT_THROW(read_inv3(ProjectFile(1).path()), std::runtime_error);
  EXPECT_THROW(read_inv3(ProjectFile(0).path()), std::runtime_error);
  EXPECT_THROW(read_inv3("/nonexistent"), std::runtime_error);
}

}  // namespace
}  // namespace isomesh::bench
