/* The C interface of the core: the only door to it, for Python (ctypes), browsers (WebAssembly) and everybody else.
 *
 * Functions that can fail return 0 when they did what they say, and otherwise fill the error. What they lend (payloads,
 * positions, faces) stays as it is until the next call with the same handle. A handle may be used by one thread at a
 * time; different handles share nothing. Texts are literals: they end with a zero byte and stay where they are.
 */
#ifndef MESHTIDE_H
#define MESHTIDE_H

#include <stdint.h>

#if defined(_WIN32)
#define MT_API __declspec(dllexport)
#else
#define MT_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- The library ---- */

/* The kind of processor that this library was compiled for ("baseline", "avx2"), and the best kind that runs on this
 * machine. Every kind computes the same bits. A binding loads the baseline library, asks it, and loads the best one. */
MT_API const char* mt_kind(void);
MT_API const char* mt_best_kind(void);

/* The digest of the sources that this library was compiled from (CMakeLists.txt); empty in WebAssembly. */
MT_API const char* mt_sources(void);

/* Codes a made sequence with all the arithmetic that streams rest on, decodes it again and returns a digest of what was
 * written: MT_SELF_CHECK on every machine where the core works; 0 if the two differ or something failed. */
#define MT_SELF_CHECK UINT64_C(0x4e951ff4f459af78)
MT_API uint64_t mt_self_check(void);

/* What kind of failure it is. */
enum mt_fault {
    MT_OK = 0,
    MT_MALFORMED = 1, /* the stream holds what no encoder writes */
    MT_LIMIT = 2,     /* more than the caller allowed; the text is the name of the limit */
    MT_MEMORY = 3,    /* the system has no memory left */
    MT_ARGUMENT = 4,  /* the caller broke the contract of a function */
    MT_VERSION = 5,   /* the stream is of another format */
    MT_INTERNAL = 6   /* a bug that a check stopped */
};

typedef struct mt_error {
    int32_t fault;    /* mt_fault */
    int32_t kind;     /* of the packet, see mt_kind; -1: none */
    int32_t level;    /* of the packet; -1: none */
    int32_t slice;    /* of the packet; -1: none */
    int64_t offset;   /* byte of the packet or the header; -1: not known */
    uint64_t claimed; /* of a limit: what is claimed, and what may be */
    uint64_t allowed;
    const char* text;
} mt_error;

/* The largest claims of a stream that a decoder accepts. */
typedef struct mt_limits {
    uint64_t vertices; /* of one level */
    uint64_t faces;    /* of one level */
    uint64_t levels;   /* states of a stream */
    uint64_t packets;
    uint64_t header_bytes;
    uint64_t packet_bytes;
    uint64_t memory;            /* bytes that decoding takes */
    uint64_t vertices_per_byte; /* of a level beyond 65536, by the bytes that tell of it */
    uint64_t faces_per_byte;    /* beyond 131072 */
} mt_limits;

/* Bytes that are lent. */
typedef struct mt_bytes {
    const uint8_t* data;
    uint64_t size;
} mt_bytes;

/* ---- The header of a stream (docs/format.md, Header) ---- */

enum mt_profile { MT_CLASSIC = 0, MT_COMPACT = 1 };
enum mt_kind { MT_BASE = 0, MT_MAP_CONN = 1, MT_PARAM = 2, MT_DIFF = 3, MT_PREVIEW = 4, MT_ORDER = 5 };

typedef struct mt_packet {
    uint64_t length;   /* bytes */
    uint32_t checksum; /* CRC-32 of them */
    uint16_t slice;
    uint8_t level;
    uint8_t kind; /* mt_kind */
} mt_packet;

/* Something that a client can show once so many packets are there. */
typedef struct mt_state {
    uint64_t vertices;
    uint64_t faces;
    double rms; /* distance from the finest mesh, as a share of its diagonal; stored rounded up */
    double maximum;
    uint32_t packet_count;
    uint32_t level;
} mt_state;

typedef struct mt_header {
    int32_t profile; /* mt_profile */
    int32_t bits;    /* B */
    double origin[3];
    double extent;
    const mt_packet* packets;
    uint64_t packet_count;
    const mt_state* states;
    uint64_t state_count;
    /* Profile compact. */
    int32_t effort;         /* 0 default, 1 high */
    int32_t mirror_axis;    /* 0..2; -1: no plane of symmetry */
    int32_t mirror_sum;     /* of a coordinate and its mirrored one, in finest steps */
    int32_t base_depth;     /* by the packets */
    uint32_t diff_depths;   /* by the packets: bit b for depth b */
    uint32_t previews;      /* by the packets */
    uint8_t strengths[24];  /* of the display filter, 0..15, from the base depth on */
    const uint64_t* slices; /* the first Morton code of each, ascending from 0 */
    uint64_t slice_count;
    /* Profile classic. */
    uint32_t levels;
    uint32_t diffs;     /* bit l: level l sends a Diff */
    uint8_t shifts[24]; /* bits that each level has dropped, level 0 first */
    int32_t filter;     /* 0 zeroth, 1 gaussian, 2 taubin, 3 polynomial, 4 rational */
    int32_t degree;
    int32_t denominator_degree;
    int32_t chebyshev; /* basis: 0 powers of K, 1 Chebyshev polynomials of K - I */
    double norm;       /* what the encoder minimised; 0: l-infinity */
    double taubin_lambda;
    double taubin_mu;
} mt_header;

typedef struct mt_stream mt_stream; /* a header that was parsed or written */

MT_API int32_t mt_stream_parse(const uint8_t* bytes, uint64_t size, const mt_limits* limits, mt_stream** stream,
                               mt_error* error);
/* The bytes of a header; what it says of its packets is not looked at. */
MT_API int32_t mt_stream_write(const mt_header* header, mt_stream** stream, mt_bytes* bytes, mt_error* error);
MT_API void mt_stream_free(mt_stream* stream);
/* Lent until the stream is freed. */
MT_API const mt_header* mt_stream_header(const mt_stream* stream);

/* ---- Decoding profile compact ---- */

typedef struct mt_decoder mt_decoder;

/* What is drawn of a level. */
typedef struct mt_shown {
    const double* positions; /* three for each vertex, in finest steps */
    uint64_t vertex_count;
    const int32_t* faces; /* three corners each, the least one first, in lexicographic order */
    uint64_t face_count;
} mt_shown;

/* The stream has to outlive the decoder. */
MT_API int32_t mt_decoder_new(const mt_stream* stream, const mt_limits* limits, mt_decoder** decoder, mt_error* error);
MT_API void mt_decoder_free(mt_decoder* decoder);
/* Takes one packet, in any order. After a failure what was decoded before stays usable. */
MT_API int32_t mt_decoder_push(mt_decoder* decoder, int32_t kind, int32_t level, int32_t slice, const uint8_t* payload,
                               uint64_t size, mt_error* error);
/* Levels that can be shown, and those of them that are as the encoder made them: bit l for level l. */
MT_API uint64_t mt_decoder_available(const mt_decoder* decoder);
MT_API uint64_t mt_decoder_exact(const mt_decoder* decoder);
MT_API int32_t mt_decoder_show(mt_decoder* decoder, int32_t level, mt_shown* shown, mt_error* error);

/* ---- Encoding profile compact ---- */

typedef struct mt_encoder mt_encoder;

typedef struct mt_encoder_options {
    int32_t bits; /* of the positions */
    int32_t effort;
    int32_t mirror_axis; /* -1: no plane of symmetry */
    int32_t mirror_sum;
    const uint64_t* slices; /* the first Morton code of each, ascending from 0 */
    uint64_t slice_count;
} mt_encoder_options;

/* positions: three grid coordinates for each vertex, all different, in Morton order; faces: three different corners
 * each, none twice, however they are rotated. Both are copied. */
MT_API int32_t mt_encoder_new(const int32_t* positions, uint64_t vertex_count, const int32_t* faces,
                              uint64_t face_count, const mt_encoder_options* options, mt_encoder** encoder,
                              mt_error* error);
MT_API void mt_encoder_free(mt_encoder* encoder);
/* Cells and faces of the depths 0 .. bits. */
MT_API int32_t mt_encoder_sizes(const mt_encoder* encoder, uint64_t* cells, uint64_t* faces);
/* The payloads in the order in which a stream has them: the Base with the levels down to a depth, the next level's Map
 * and faces, the bit planes of a slice down to the depth of a level that is coded. */
MT_API int32_t mt_encoder_base(mt_encoder* encoder, int32_t depth, mt_bytes* payload, mt_error* error);
MT_API int32_t mt_encoder_next_level(mt_encoder* encoder, mt_bytes* payload, mt_error* error);
MT_API int32_t mt_encoder_planes(mt_encoder* encoder, int32_t slice, int32_t depth, mt_bytes* payload, mt_error* error);
/* Instead of all of them: the whole mesh as a preview's payload. */
MT_API int32_t mt_encoder_preview(mt_encoder* encoder, mt_bytes* payload, mt_error* error);

#ifdef __cplusplus
}
#endif

#endif
