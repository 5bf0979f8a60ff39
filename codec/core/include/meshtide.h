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
#define MT_SELF_CHECK UINT64_C(0xc27408df8adccce7)
MT_API uint64_t mt_self_check(void);

/* What kind of failure it is. */
enum mt_fault {
    MT_OK = 0,
    MT_MALFORMED = 1,  /* the stream holds what no encoder writes */
    MT_LIMIT = 2,      /* more than the caller allowed; the text is the name of the limit */
    MT_MEMORY = 3,     /* the system has no memory left */
    MT_ARGUMENT = 4,   /* the caller broke the contract of a function */
    MT_VERSION = 5,    /* the stream is of another format */
    MT_INTERNAL = 6,   /* a bug that a check stopped */
    MT_UNSUPPORTED = 7 /* the smaller WebAssembly only: the stream needs meshtide-full.wasm */
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
    uint64_t vertices_per_byte; /* of a level beyond 65536, by the bytes that code it */
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

/* Both distances of a state as a header holds them, which is never less. */
MT_API void mt_stored_distances(double* rms, double* maximum);

typedef struct mt_stream mt_stream; /* a header that was parsed or written */

MT_API int32_t mt_stream_parse(const uint8_t* bytes, uint64_t size, const mt_limits* limits, mt_stream** stream,
                               mt_error* error);
/* The bytes of a header; what it says of its packets is not looked at. */
MT_API int32_t mt_stream_write(const mt_header* header, mt_stream** stream, mt_bytes* bytes, mt_error* error);
MT_API void mt_stream_free(mt_stream* stream);
/* Lent until the stream is freed. */
MT_API const mt_header* mt_stream_header(const mt_stream* stream);

/* ---- Trained states: what coders know before a stream begins (docs/format.md, Trained states) ---- */

typedef struct mt_states mt_states;

/* None is loaded at first; null if there is no memory. They are only read by coders, so threads may share them. */
MT_API mt_states* mt_states_new(void);
MT_API void mt_states_free(mt_states* states);
/* Those of an effort (0 default, 1 high) or of profile classic (2), from their file. Default's are also those of every
 * preview. */
MT_API int32_t mt_states_load(mt_states* states, int32_t effort, const uint8_t* bytes, uint64_t size, mt_error* error);

/* ---- Decoding ---- */

typedef struct mt_decoder mt_decoder;

/* What is drawn of a level. */
typedef struct mt_shown {
    const double* positions; /* three for each vertex, in finest steps */
    uint64_t vertex_count;
    const int32_t* faces; /* three corners each, the least one first, in lexicographic order */
    uint64_t face_count;
} mt_shown;

/* The stream and the states have to outlive the decoder. */
MT_API int32_t mt_decoder_new(const mt_stream* stream, const mt_limits* limits, const mt_states* states,
                              mt_decoder** decoder, mt_error* error);
MT_API void mt_decoder_free(mt_decoder* decoder);
/* From now on a level that a finer one replaces need not be shown, and takes no memory. */
MT_API void mt_decoder_keep_finest_only(mt_decoder* decoder);
/* Takes one packet, in any order. After a failure what was decoded before stays usable. */
MT_API int32_t mt_decoder_push(mt_decoder* decoder, int32_t kind, int32_t level, int32_t slice, const uint8_t* payload,
                               uint64_t size, mt_error* error);
/* Levels that can be shown, and those of them that are as the encoder made them: bit l for level l. */
MT_API uint64_t mt_decoder_available(const mt_decoder* decoder);
MT_API uint64_t mt_decoder_exact(const mt_decoder* decoder);
/* Those that became available or better by the last push. */
MT_API uint64_t mt_decoder_changed(const mt_decoder* decoder);
/* Bytes of the Base and Map&Conn packets so far that code vertices (Map, in profile classic cells and children); to
 * a few, since both are coded in one go. The others code faces. */
MT_API uint64_t mt_decoder_map_bytes(const mt_decoder* decoder);
/* Fails as malformed, too: where a damaged stream has coded a face twice, it is found here. */
MT_API int32_t mt_decoder_show(mt_decoder* decoder, int32_t level, mt_shown* shown, mt_error* error);

/* For experiments with noise on Diffs: after `watch_diffs`, before the first packet, a push keeps the Diffs that it has
 * decoded (of its own packet, and of others that had to wait for it), also when it failed in the end. Other numbers, as
 * many and finite, may be added in the place of each, until the next push. In profile compact Diffs are how far the
 * vertices of leaves move, in the order of the slice, and no vertex leaves its leaf cell by others; what is decoded
 * later does not depend on them. */
typedef struct mt_diffs {
    const double* values; /* three for each vertex, in steps of the level's grid; lent until the next push */
    uint64_t count;       /* of vertices */
    int32_t level;
    int32_t slice;
} mt_diffs;

MT_API void mt_decoder_watch_diffs(mt_decoder* decoder);
MT_API uint64_t mt_decoder_diff_count(const mt_decoder* decoder);
MT_API int32_t mt_decoder_diffs(const mt_decoder* decoder, uint64_t number, mt_diffs* diffs, mt_error* error);
MT_API int32_t mt_decoder_replace_diffs(mt_decoder* decoder, uint64_t number, const double* values, uint64_t count,
                                        mt_error* error);

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
                              uint64_t face_count, const mt_encoder_options* options, const mt_states* states,
                              mt_encoder** encoder, mt_error* error);
MT_API void mt_encoder_free(mt_encoder* encoder);
/* Cells and faces of the depths 0 .. bits. */
MT_API int32_t mt_encoder_sizes(const mt_encoder* encoder, uint64_t* cells, uint64_t* faces);
/* The payloads in the order in which a stream has them: the Base with the levels down to a depth, then the next level's
 * Map and faces. */
MT_API int32_t mt_encoder_base(mt_encoder* encoder, int32_t depth, mt_bytes* payload, mt_error* error);
MT_API int32_t mt_encoder_next_level(mt_encoder* encoder, mt_bytes* payload, mt_error* error);
/* A slice's bit planes down to the depth of a level that is coded are added to its next Diff; about how long that is by
 * now, 0 only where there was nothing to code. Taken, it may be empty though there was, and the next plane begins another
 * one. */
MT_API int32_t mt_encoder_add_planes(mt_encoder* encoder, int32_t slice, int32_t depth, uint64_t* size,
                                     mt_error* error);
MT_API int32_t mt_encoder_take_planes(mt_encoder* encoder, int32_t slice, mt_bytes* payload, mt_error* error);
/* Nothing will be coded any more; that takes no memory then. The functions below can still be called. */
MT_API void mt_encoder_finish(mt_encoder* encoder);
/* Which strength of the display filter brings each depth from `first` to `bits` nearest to the mesh. */
MT_API int32_t mt_encoder_strengths(mt_encoder* encoder, int32_t first, uint8_t* strengths, mt_error* error);
/* What is drawn of a depth when the Diffs down to `known_depth` are there, as in mt_shown, written into arrays for as many
 * vertices and faces as mt_encoder_sizes gives them. */
MT_API int32_t mt_encoder_show(mt_encoder* encoder, int32_t depth, int32_t known_depth, int32_t strength,
                               double* positions, int32_t* faces, mt_error* error);
/* ---- Encoding profile classic: levels are the caller's, payloads the core's ---- */

typedef struct mt_classic_encoder mt_classic_encoder;

MT_API int32_t mt_classic_encoder_new(const mt_states* states, mt_classic_encoder** encoder, mt_error* error);
MT_API void mt_classic_encoder_free(mt_classic_encoder* encoder);
/* The payloads, lent until the next call. The Base comes first, then a Map&Conn for each finer level; Diffs may come at
 * any time. Faces are canonical: three different corners each, the least one first, in lexicographic order, none twice.
 * cells: three coordinates below 2^bits for each vertex, in Morton order, none twice. parents: of each vertex, its one
 * in the level before; they ascend, and none is left out. differences: three of magnitude below 2^31 for each vertex.
 */
MT_API int32_t mt_classic_encoder_base(mt_classic_encoder* encoder, const int32_t* cells, uint64_t vertex_count,
                                       int32_t bits, const int32_t* faces, uint64_t face_count, mt_bytes* payload,
                                       mt_error* error);
MT_API int32_t mt_classic_encoder_map_conn(mt_classic_encoder* encoder, const int32_t* parents, uint64_t vertex_count,
                                           const int32_t* faces, uint64_t face_count, mt_bytes* payload,
                                           mt_error* error);
MT_API int32_t mt_classic_encoder_diff(mt_classic_encoder* encoder, const int32_t* differences, uint64_t vertex_count,
                                       mt_bytes* payload, mt_error* error);
/* The Diffs of one packet, which stand for themselves, into the caller's array; `level` is what a failure names. */
MT_API int32_t mt_classic_decode_diff(int32_t level, const uint8_t* payload, uint64_t size, uint64_t vertex_count,
                                      int32_t* differences, mt_error* error);

/* ---- Filters of profile classic (docs/format.md, Param and prediction) ---- */

/* The vertex graph of a mesh: neighbours of vertex v are neighbours[offsets[v]], ..., neighbours[offsets[v + 1] - 1],
 * in ascending order. */
typedef struct mt_graph mt_graph;

typedef struct mt_graph_lists {
    const uint32_t* offsets; /* one more than there are vertices; lent until the graph is freed */
    const int32_t* neighbours;
    uint64_t vertex_count;
    uint64_t neighbour_count;
} mt_graph_lists;

/* An edge joins any two different vertices of one face. */
MT_API int32_t mt_graph_new(const int32_t* faces, uint64_t face_count, uint64_t vertex_count, mt_graph** graph,
                            mt_error* error);
MT_API void mt_graph_free(mt_graph* graph);
MT_API void mt_graph_get_lists(const mt_graph* graph, mt_graph_lists* lists);
/* K times values, one or three (`columns`) for each vertex: every value minus the mean of its neighbours'; 0 without
 * any. */
MT_API int32_t mt_graph_apply(const mt_graph* graph, const double* values, int32_t columns, double* products,
                              mt_error* error);

/* As in mt_header. */
typedef struct mt_filter {
    int32_t kind;
    int32_t chebyshev;
    int32_t degree;
    int32_t denominator_degree;
    double taubin_lambda;
    double taubin_mu;
} mt_filter;

/* The filtered extension, three coordinates for each vertex. coefficients: those of x, then y, then z, as many as the
 * filter takes. */
MT_API int32_t mt_graph_predict(const mt_graph* graph, const mt_filter* filter, const float* coefficients,
                                const double* extension, double* prediction, mt_error* error);
/* Solves (1 + q_1 K + q_2 K^2 + ...) x = values in place, to a relative residual of 1e-11; the denominator is safe. */
MT_API int32_t mt_graph_divide(const mt_graph* graph, const float* denominator, uint64_t degree, double* values,
                               mt_error* error);
/* Whether 1 + q_1 t + q_2 t^2 + ... is provably positive on [0, 2], and its solution provably quick. */
MT_API int32_t mt_is_safe_denominator(const float* denominator, uint64_t degree);
/* The sum of products, in four interleaved lanes: the same bits on every machine. */
MT_API double mt_dot(const double* first, const double* second, uint64_t count);

/* ---- What an encoder looks for in a mesh ---- */

/* The mirror plane that takes the largest share of the vertices to vertices: its axis (-1: none is worth its contexts),
 * and the sum of a coordinate and its mirrored one. Positions are as those of mt_grid_mesh, in any order. */
MT_API int32_t mt_find_mirror(const int32_t* positions, uint64_t vertex_count, int32_t bits, int32_t* axis,
                              int32_t* sum, mt_error* error);

/* On a grid: three coordinates in [0, 2^bits) for each vertex, all different, in Morton order. */
typedef struct mt_grid_mesh {
    const int32_t* positions;
    uint64_t vertex_count;
    const int32_t* faces; /* three corners each */
    uint64_t face_count;
    int32_t bits;
} mt_grid_mesh;

/* A small mesh on a grid of its own over the same cube. */
typedef struct mt_preview {
    mt_grid_mesh mesh; /* every vertex is in use; faces as in mt_shown */
    mt_bytes payload;  /* of its packet */
} mt_preview;

typedef struct mt_previews mt_previews; /* the coarsest first; there may be none */

/* Those that come close to the mesh with few bytes. The states of effort default have to be loaded. */
MT_API int32_t mt_previews_choose(const mt_grid_mesh* mesh, const mt_states* states, mt_previews** previews,
                                  mt_error* error);
/* One of about 1/ratio of the vertices for each ratio, of 2 or more, where that makes sense. */
MT_API int32_t mt_previews_make(const mt_grid_mesh* mesh, const uint64_t* ratios, uint64_t ratio_count,
                                const mt_states* states, mt_previews** previews, mt_error* error);
MT_API void mt_previews_free(mt_previews* previews);
MT_API uint64_t mt_previews_count(const mt_previews* previews);
/* Lent until they are freed. */
MT_API const mt_preview* mt_previews_list(const mt_previews* previews);

/* ---- Surfaces ---- */

/* Finite vertices, at least one, of three coordinates each; without faces it is the set of its vertices. */
typedef struct mt_surface {
    const double* vertices;
    uint64_t vertex_count;
    const int32_t* faces; /* three corners each */
    uint64_t face_count;
} mt_surface;

/* Points of a surface: where they are, the three vertices of their faces, and the weights of those, which sum up to 1.
 * The arrays are the caller's, three numbers for each point. */
typedef struct mt_points {
    double* points;
    int32_t* corners;
    double* weights;
} mt_points;

typedef struct mt_tree mt_tree; /* a copy of a surface, ready for searches; many threads may search it */

MT_API int32_t mt_tree_new(const mt_surface* surface, mt_tree** tree, mt_error* error);
MT_API void mt_tree_free(mt_tree* tree);
/* The closest point for each of some, which have three coordinates; fast if neighbours follow each other. */
MT_API int32_t mt_tree_closest(const mt_tree* tree, const double* points, uint64_t count, const mt_points* closest,
                               mt_error* error);
/* So many points, evenly by area; the same seed gives the same ones. */
MT_API int32_t mt_tree_sample(const mt_tree* tree, uint64_t seed, uint64_t count, const mt_points* samples,
                              mt_error* error);

typedef struct mt_meter mt_meter; /* measures surfaces against one; many threads may use it */

/* samples: of each surface; vertex_limit: vertices of each that the maximum looks at; of more, every second and so on.
 * The original's faces, not its vertices, must stay as they are as long as the meter is used. */
MT_API int32_t mt_meter_new(const mt_surface* original, uint64_t samples, uint64_t vertex_limit, uint64_t seed,
                            mt_meter** meter, mt_error* error);
MT_API void mt_meter_free(mt_meter* meter);
/* Distances of the two surfaces, as fractions of the diagonal of the original's box. */
MT_API int32_t mt_meter_measure(const mt_meter* meter, const mt_surface* other, double* rms, double* maximum,
                                mt_error* error);

typedef struct mt_simplifier mt_simplifier; /* a mesh that gets simpler from call to call, by quadric errors */

/* finest: the greatest number of vertices that will be asked for. */
MT_API int32_t mt_simplifier_new(const mt_grid_mesh* mesh, uint64_t finest, mt_simplifier** simplifier,
                                 mt_error* error);
MT_API void mt_simplifier_free(mt_simplifier* simplifier);
/* To `target` vertices, or as near as it goes, in steps of the mesh's grid; every vertex is in use, faces are as in
 * mt_shown. Lent until the next call. */
MT_API int32_t mt_simplifier_reduce(mt_simplifier* simplifier, uint64_t target, mt_surface* reduced, mt_error* error);

/* ---- The input's order (docs/format.md, Order) ---- */

typedef struct mt_input_order {
    const uint32_t* vertices; /* of the stream, that each input vertex became */
    uint64_t vertex_count;
    const uint32_t* faces; /* input vertices, three for each input face */
    uint64_t face_count;
} mt_input_order;

/* The finest mesh of a stream. */
typedef struct mt_stream_mesh {
    const int32_t* faces; /* as in mt_shown */
    uint64_t face_count;
    uint64_t vertex_count;
} mt_stream_mesh;

typedef struct mt_order mt_order; /* an order, or its packet; what is lent of it lives as long */

MT_API int32_t mt_order_encode(const mt_input_order* input, const mt_stream_mesh* mesh, mt_order** order,
                               mt_bytes* payload, mt_error* error);
/* other_bytes: of the stream besides this packet, which back what it claims. */
MT_API int32_t mt_order_decode(const mt_bytes* payload, const mt_stream_mesh* mesh, const mt_limits* limits,
                               uint64_t other_bytes, mt_order** order, mt_input_order* input, mt_error* error);
MT_API void mt_order_free(mt_order* order);

#ifdef __cplusplus
}
#endif

#endif
