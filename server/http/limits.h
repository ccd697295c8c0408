// The limits of requests and responses, and the times of the service that no option sets.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace isomesh::http::limits {

// Retry-After of responses 429 and 503; a wing may tell another one.
inline constexpr std::chrono::seconds kRetryAfter{1};

// --- Requests, in bytes ---

inline constexpr std::size_t kLongestTarget = 4096;
inline constexpr std::size_t kLongestPath = 256;
inline constexpr std::size_t kLongestPathParameter = 100;
inline constexpr std::size_t kMostJsonBytes = std::size_t{64} << 10;
// Of a form, which the HTTP library keeps in memory: heads of fields, and what follows a boundary.
inline constexpr std::size_t kMostBytesBesideFiles = std::size_t{1} << 20;
inline constexpr std::size_t kLongestToken = 8000;  // a header line has at most 8192 bytes
inline constexpr std::size_t kLongestUserName = 64;
inline constexpr std::size_t kLongestIdempotencyKey = 255;
inline constexpr std::size_t kLongestCursor = 128;
inline constexpr std::size_t kLongestFileName = 255;
inline constexpr std::size_t kLongestMemberName = 1024;  // of an archive
inline constexpr std::size_t kLongestUid = 64;

// --- Requests that ask for much ---

inline constexpr std::chrono::seconds kLongestWait{30};  // `wait` of a job, and `Prefer: wait`
inline constexpr std::chrono::hours kLongestSynchronousJob{24};  // POST /v1/mesh
inline constexpr std::uint64_t kMostListed = 1000;               // a page of a list
inline constexpr std::uint64_t kMostBins = 65536;                // of a histogram
inline constexpr std::uint64_t kMostPreviewSize = 256;           // samples along the longest side

// --- Event streams ---

inline constexpr std::chrono::seconds kBetweenPings{15};
inline constexpr std::chrono::milliseconds kReconnectAfter{2000};  // what browsers are told
inline constexpr std::size_t kMostUnreadEvents = 4096;             // further ones are lost

// --- The login provider (OpenID Connect) ---

inline constexpr std::chrono::seconds kClockSkew{60};  // between its clock and this one
inline constexpr std::size_t kMostProviderBytes = std::size_t{256} << 10;  // of one response
inline constexpr std::chrono::seconds kLongestProviderFetch{10};
inline constexpr std::size_t kMostSigningKeys = 64;
inline constexpr std::size_t kLongestSubject = 255;  // of a person (OpenID Connect Core, 2)

// --- The service ---

inline constexpr std::size_t kMostCancelledUploads = 1000;    // that are remembered
inline constexpr std::size_t kMostOriginsLogged = 64;         // of pages that are not allowed
inline constexpr std::chrono::seconds kBetweenEventReads{1};  // at least so often
inline constexpr std::chrono::seconds kLastResponses{5};      // to send them after the drain

}  // namespace isomesh::http::limits
