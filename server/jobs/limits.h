// The limits and times of imports, jobs and cached answers that no option sets.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace isomesh::jobs::limits {

// --- Workers ---

// How often a running job reports its progress and learns whether it should stop.
inline constexpr std::chrono::milliseconds kBetweenRenewals{100};
inline constexpr std::chrono::milliseconds kBetweenReaps{1000};
inline constexpr std::chrono::milliseconds kLongestIdle{1000};
// A job that found the disk full runs again after this, which doubles each time.
inline constexpr std::chrono::milliseconds kFullDiskDelay{5000};
inline constexpr std::chrono::milliseconds kLongestFullDiskDelay{60'000};
// A job that lacked descriptors or memory runs again after this.
inline constexpr std::chrono::milliseconds kExhaustedDelay{5000};
// Between attempts to record the end of a job.
inline constexpr std::chrono::milliseconds kEndRetry{500};

// --- Processes of jobs and imports ---

// For a process to exit after it closed its socket.
inline constexpr std::chrono::milliseconds kExit{2000};
// A job process that does not stop within this time is killed. Kernels check for cancellation once
// per slab, but libdraco encodes a whole stream without checking.
inline constexpr std::chrono::milliseconds kStop{300};
// A process may die while idle; several in a row are a defect.
inline constexpr int kMostIdleDeaths = 3;
inline constexpr std::size_t kMostImportMessages = std::size_t{16} << 20;  // bytes
// The triangles of 65 535 labels take about 3 MB.
inline constexpr std::size_t kLongestJobMessage = std::size_t{16} << 20;

// Processor time of an import, below --import-seconds (its default is in ImportBounds): small
// uploads take long only if they are malicious. Honest uploads are read at many megabytes per
// second.
inline constexpr std::chrono::seconds kLeastImportTime{20};
inline constexpr std::uint64_t kImportBytesPerSecond = 64 * 1024;

// --- Answers, cached for each viewer ---

inline constexpr std::size_t kHistograms = 32;   // at most half a megabyte each
inline constexpr std::size_t kLabelCounts = 16;  // at most 3 MB each
inline constexpr std::size_t kLabelLists = 4;    // at most about 10 MB each
inline constexpr std::size_t kSurfaceCounts = 1024;
inline constexpr std::size_t kMostWaitingForAnswers = 12;  // of each kind
// Far more than a page with long names and files in every format needs.
inline constexpr std::uint64_t kMostLabelPageBytes = std::uint64_t{64} << 20;

}  // namespace isomesh::jobs::limits
