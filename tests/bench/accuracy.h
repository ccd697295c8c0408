// Measures the accuracy and cost of simplification, compared with other tools at equal triangle
// counts. Also measures the time of certification.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "proto/mesh_summary.h"
#include "server/mesh/measure/distance.h"
#include "tests/bench/rows.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// Parameters of the accuracy measurements.
struct AccuracyPlan {
  double iso = 0;
  int passes = 5;
  int threads = 1;
  std::vector<double> errors_mm = {0.02, 0.05, 0.1, 0.2, 0.5};
  bool with_peers = true;  // the slow ones, where they were found
};

// One way to fewer triangles. Zero where something was not measured.
struct Approximation {
  std::string name;
  double error_mm = 0;   // the bound, of a job that has one
  bool is_peer = false;  // else a job of isomesh
  std::uint64_t triangles = 0;
  DistanceSummary to_scan = {};    // from the mesh to the surface as it was extracted
  DistanceSummary from_scan = {};  // the other way
  double simplify_ms = 0;
  double certify_ms = 0;
  double encode_ms = 0;  // to drc
  double job_ms = 0;     // from the samples in memory to the bytes of the file, and the certificate
  std::uint64_t bytes = 0;
};

// A job that bounds nothing, the same with a certificate, then for each error a job with that
// bound, and behind it others that make as many triangles of the smoothed surface. Each is run
// once: to be repeated by whoever wants to know how steady times are.
std::vector<Approximation> measure_approximations(const Samples& samples, const AccuracyPlan& plan);

// The smoothed surface against the extracted one and the other way round: milliseconds of both
// ways together, the median of some runs, and what they find.
struct CertifyTime {
  int threads = 1;
  std::uint64_t points = 0;
  double ms = 0;
  mesh::Certificate certificate;
};
CertifyTime measure_certify(const Samples& samples, const AccuracyPlan& plan);

// A job by the labels of 20^3 random samples, with a certificate, at some spacings: the same
// triangles, but many times as long in one direction.
struct UnevenTime {
  double spacing_z = 1;
  std::uint64_t triangles = 0;
  double certify_ms = 0;
  double job_ms = 0;
  double expected_ms = 0;  // of the certificate, by stage_times.h
};
std::vector<UnevenTime> measure_uneven(int threads);

// One object for each.
Json to_json(const std::vector<Approximation>& approximations);
Json to_json(const CertifyTime& time);
Json to_json(const std::vector<UnevenTime>& times);

}  // namespace isomesh::bench
