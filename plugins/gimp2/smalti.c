/* smalti for GIMP 2.10: Filters > Artistic > smalti... makes a mosaic of the layer, or of the selected part of it.
 *
 * Build it with `gimptool-2.0 --build smalti.c`, with the two headers in the same folder. This file has the procedure,
 * and takes pixels out of layers and back. smalti_dialog.h asks for the options, smalti_program.h runs the program. */
#include "smalti_dialog.h"
#include "smalti_program.h"

#define PROCEDURE "plug-in-smalti"

/* The part of a layer that becomes a mosaic, and where it lies. */
typedef struct {
    gint32 image, layer;
    gint x, y, width, height;   /* within the layer */
    gint canvas_x, canvas_y;    /* within the image */
    gboolean is_selected;       /* whether there is a selection */
} Part;

/* Where GIMP has found this plug-in. */
static const gchar *own_path;

static void query(void)
{
    static const GimpParamDef asked[] = {
        {GIMP_PDB_INT32, "run-mode", "RUN-INTERACTIVE (0), RUN-NONINTERACTIVE (1) or RUN-WITH-LAST-VALS (2)"},
        {GIMP_PDB_IMAGE, "image", "The image"},
        {GIMP_PDB_DRAWABLE, "drawable", "The layer"},
        {GIMP_PDB_STRING, "style", "mosaic, paint, spray or free"},
        {GIMP_PDB_INT32, "tiles", "Number of tiles, 1 to 1000000, or 0 for as many as suit the size"},
        {GIMP_PDB_INT32, "seed", "Number that decides every random choice, from 0"},
        {GIMP_PDB_STRING, "mask", "auto, square, border, lines, flower, disc, triangle, hexagon or brush"},
        {GIMP_PDB_STRING, "grout", "style, none, auto or color"},
        {GIMP_PDB_COLOR, "grout-color", "Colour of the grout, if grout is color"},
        {GIMP_PDB_INT32, "evals", "Number of changes to try, or 0 for as many as suit the tiles"},
        {GIMP_PDB_INT32, "size", "Longer side in px at which the picture evolves, 16 to 8192"},
        {GIMP_PDB_FLOAT, "scale", "Size of the result, 0.1 to 16; other than 1 it becomes a new image"},
        {GIMP_PDB_INT32, "new-layer", "TRUE: as a new layer. FALSE: in place of the layer's pixels"},
    };
    static const GimpParamDef given[] = {{GIMP_PDB_LAYER, "layer", "The layer with the mosaic"}};
    gimp_install_procedure(PROCEDURE, "Lay the picture in tiles",
                           "Has the program smalti evolve a mosaic, brush strokes or clouds of spray from the layer "
                           "or the selected part of it. The same layer, options and seed give the same result.",
                           "smalti", "smalti", "2.10", "_smalti...", "*", GIMP_PLUGIN, G_N_ELEMENTS(asked),
                           G_N_ELEMENTS(given), asked, given);
    gimp_plugin_menu_register(PROCEDURE, "<Image>/Filters/Artistic");
}

static gint choice_named(const gchar *what, const Choice *choices, gint count, const gchar *name, GError **error)
{
    GString *names = g_string_new(NULL);
    gint found = -1;
    for (gint place = 0; place < count; place++) {
        g_string_append_printf(names, place ? ", %s" : "%s", choices[place].name);
        if (g_strcmp0(choices[place].name, name) == 0)
            found = place;
    }
    if (found < 0 && !*error)
        refuse(error, "%s must be one of %s; \"%s\" is none of them", what, names->str, name ? name : "");
    g_string_free(names, TRUE);
    return found;
}

static gdouble in_range(const gchar *what, gdouble value, gdouble low, gdouble high, GError **error)
{
    if (!(value >= low && value <= high) && !*error)
        refuse(error, "%s must be %.10g to %.10g, and is %.10g", what, low, high, value);
    return value;
}

/* The options of a call from a script; the first that is wrong is named. */
static gboolean read_options(gint count, const GimpParam *given, Options *options, GError **error)
{
    GError *why = NULL;
    if (count != 13) {
        refuse(error, PROCEDURE " takes 13 values, and was given %d", count);
        return FALSE;
    }
    options->style = choice_named("style", STYLES, G_N_ELEMENTS(STYLES), given[3].data.d_string, &why);
    options->tiles = in_range("tiles", given[4].data.d_int32, 0, TILES_MAX, &why);
    options->seed = in_range("seed", given[5].data.d_int32, 0, G_MAXINT32, &why);
    options->mask = choice_named("mask", MASKS, G_N_ELEMENTS(MASKS), given[6].data.d_string, &why);
    options->grout = choice_named("grout", GROUTS, G_N_ELEMENTS(GROUTS), given[7].data.d_string, &why);
    options->grout_color = given[8].data.d_color;
    options->evals = in_range("evals", given[9].data.d_int32, 0, G_MAXINT32, &why);
    options->size = in_range("size", given[10].data.d_int32, SIZE_MIN_PX, SIZE_MAX_PX, &why);
    options->scale = in_range("scale", given[11].data.d_float, SCALE_MIN, SCALE_MAX, &why);
    options->on_new_layer = in_range("new-layer", given[12].data.d_int32, FALSE, TRUE, &why);
    if (why)
        g_propagate_error(error, why);
    return !why;
}

/* What there is to work on; FALSE and an error if it is nothing that can become a mosaic. */
static gboolean find_part(gint32 image, gint32 drawable, Part *part, GError **error)
{
    *part = (Part){.image = image, .layer = drawable, .is_selected = !gimp_selection_is_empty(image)};
    if (gimp_image_get_floating_sel(image) != -1)
        refuse(error, "There is a floating selection; anchor it or make it a layer, and try again");
    else if (gimp_item_is_layer_mask(drawable))
        refuse(error, "The layer's mask is chosen; choose the layer itself");
    else if (!gimp_item_is_layer(drawable))
        refuse(error, "A channel has no colours; choose a layer");
    else if (gimp_item_is_group(drawable))
        refuse(error, "A layer group has no pixels of its own; choose a layer in it, or merge the group");
    else if (!gimp_drawable_mask_intersect(drawable, &part->x, &part->y, &part->width, &part->height))
        refuse(error, "The selection does not meet the layer; select a part of it, or nothing to take all of it");
    else {
        gimp_drawable_offsets(drawable, &part->canvas_x, &part->canvas_y);
        part->canvas_x += part->x;
        part->canvas_y += part->y;
        return TRUE;
    }
    return FALSE;
}

/* Makes clear what is not selected at all. */
static void clear_unselected(const Part *part, GdkPixbuf *picture)
{
    guchar *selected = g_malloc((gsize)part->width * part->height);
    GeglBuffer *selection = gimp_drawable_get_buffer(gimp_image_get_selection(part->image));
    gegl_buffer_get(selection, GEGL_RECTANGLE(part->canvas_x, part->canvas_y, part->width, part->height), 1,
                    babl_format("Y u8"), selected, part->width, GEGL_ABYSS_NONE);
    g_object_unref(selection);
    for (gint y = 0; y < part->height; y++) {
        guchar *row = gdk_pixbuf_get_pixels(picture) + (gsize)y * gdk_pixbuf_get_rowstride(picture);
        for (gint x = 0; x < part->width; x++)
            if (!selected[(gsize)y * part->width + x])
                row[4 * x + 3] = 0;
    }
    g_free(selected);
}

/* The pixels as 8-bit sRGB. GIMP converts modes, depths and profiles itself, from one image to another. */
static GdkPixbuf *pixels_of(const Part *part, GError **error)
{
    GdkPixbuf *picture = gdk_pixbuf_new(GDK_COLORSPACE_RGB, TRUE, 8, part->width, part->height);
    if (!picture) {
        refuse(error, "There is not enough memory for a picture of %d x %d px", part->width, part->height);
        return NULL;
    }
    const gint32 srgb =
        gimp_image_new(gimp_drawable_width(part->layer), gimp_drawable_height(part->layer), GIMP_RGB);
    gimp_image_undo_disable(srgb);
    const gint32 copy = gimp_layer_new_from_drawable(part->layer, srgb);
    gimp_image_insert_layer(srgb, copy, -1, 0);
    GeglBuffer *buffer = gimp_drawable_get_buffer(copy);
    gegl_buffer_get(buffer, GEGL_RECTANGLE(part->x, part->y, part->width, part->height), 1,
                    babl_format("R'G'B'A u8"), gdk_pixbuf_get_pixels(picture), gdk_pixbuf_get_rowstride(picture),
                    GEGL_ABYSS_NONE);
    g_object_unref(buffer);
    gimp_image_delete(srgb);
    return picture;
}

/* Fills a layer of the same size. */
static void paint(gint32 layer, GdkPixbuf *made)
{
    GeglBuffer *buffer = gimp_drawable_get_buffer(layer);
    gegl_buffer_set(buffer, GEGL_RECTANGLE(0, 0, gdk_pixbuf_get_width(made), gdk_pixbuf_get_height(made)), 0,
                    babl_format(gdk_pixbuf_get_has_alpha(made) ? "R'G'B'A u8" : "R'G'B' u8"),
                    gdk_pixbuf_get_pixels(made), gdk_pixbuf_get_rowstride(made));
    g_object_unref(buffer);
    gimp_drawable_update(layer, 0, 0, gdk_pixbuf_get_width(made), gdk_pixbuf_get_height(made));
}

/* A layer of the mosaic for the part's image, in its mode, depth and profile, and of the part's size. */
static gint32 converted(const Part *part, GdkPixbuf *made)
{
    const gint width = gdk_pixbuf_get_width(made), height = gdk_pixbuf_get_height(made);
    const gint32 srgb = gimp_image_new(width, height, GIMP_RGB);
    gimp_image_undo_disable(srgb);
    const gint32 layer = gimp_layer_new(srgb, "smalti", width, height, GIMP_RGBA_IMAGE, 100, GIMP_LAYER_MODE_NORMAL);
    gimp_image_insert_layer(srgb, layer, -1, 0);
    paint(layer, made);
    /* The shorter side may be a pixel off: the program rounds it once when it reduces the picture, and once again. */
    if (width != part->width || height != part->height)
        gimp_layer_scale(layer, part->width, part->height, FALSE);
    const gint32 own = gimp_layer_new_from_drawable(layer, part->image);
    gimp_image_delete(srgb);
    return own;
}

static void name_after(gint32 layer, const Part *part)
{
    gchar *source = gimp_item_get_name(part->layer);
    gchar *name = g_strdup_printf("%s in tiles", source);
    gimp_item_set_name(layer, name);
    g_free(name);
    g_free(source);
}

/* Multiplies a mask of the part's size by what another drawable has from (x, y) on. */
static void narrow(gint32 mask, gint32 other, gint x, gint y, const Part *part)
{
    enum { BAND_PX = 64 };
    const Babl *format = babl_format("Y float");
    GeglBuffer *to = gimp_drawable_get_buffer(mask), *from = gimp_drawable_get_buffer(other);
    gfloat *shown = g_new(gfloat, (gsize)part->width * BAND_PX), *factors = g_new(gfloat, (gsize)part->width * BAND_PX);
    for (gint top = 0; top < part->height; top += BAND_PX) {
        const gint height = MIN(BAND_PX, part->height - top);
        const GeglRectangle band = {0, top, part->width, height}, cut = {x, y + top, part->width, height};
        gegl_buffer_get(to, &band, 1, format, shown, GEGL_AUTO_ROWSTRIDE, GEGL_ABYSS_NONE);
        gegl_buffer_get(from, &cut, 1, format, factors, GEGL_AUTO_ROWSTRIDE, GEGL_ABYSS_NONE);
        for (gsize pixel = 0; pixel < (gsize)part->width * height; pixel++)
            shown[pixel] *= factors[pixel];
        gegl_buffer_set(to, &band, 0, format, shown, GEGL_AUTO_ROWSTRIDE);
    }
    g_free(factors);
    g_free(shown);
    g_object_unref(from);
    g_object_unref(to);
}

/* Masks a layer of the part's size: what is to be seen of it is selected, and the source's own mask shows it. */
static void mask_as_source(gint32 layer, const Part *part)
{
    const gint32 own = gimp_layer_get_mask(part->layer);
    const gboolean is_masked = own != -1 && gimp_layer_get_apply_mask(part->layer);
    if (!part->is_selected && !is_masked)
        return;
    const gint32 mask = gimp_layer_create_mask(layer, GIMP_ADD_MASK_WHITE);
    if (part->is_selected)
        narrow(mask, gimp_image_get_selection(part->image), part->canvas_x, part->canvas_y, part);
    if (is_masked)
        narrow(mask, own, part->x, part->y, part);
    gimp_layer_add_mask(layer, mask);
    /* Else the mask would be chosen, and the next filter would change it. */
    gimp_layer_set_edit_mask(layer, FALSE);
}

static gint32 lay_above(const Part *part, GdkPixbuf *made)
{
    const gint32 layer = converted(part, made);
    name_after(layer, part);
    gimp_image_insert_layer(part->image, layer, gimp_item_get_parent(part->layer),
                            gimp_image_get_item_position(part->image, part->layer));
    gimp_layer_set_offsets(layer, part->canvas_x, part->canvas_y);
    mask_as_source(layer, part);
    return layer;
}

/* Puts the mosaic in place of the layer's pixels, as much as they are selected. */
static gint32 replace(const Part *part, GdkPixbuf *made)
{
    const gint32 layer = converted(part, made);
    GeglBuffer *from = gimp_drawable_get_buffer(layer);
    GeglBuffer *shadow = gimp_drawable_get_shadow_buffer(part->layer);
    gegl_buffer_copy(from, GEGL_RECTANGLE(0, 0, part->width, part->height), GEGL_ABYSS_NONE, shadow,
                     GEGL_RECTANGLE(part->x, part->y, part->width, part->height));
    g_object_unref(shadow);
    g_object_unref(from);
    gimp_item_delete(layer);
    gimp_drawable_merge_shadow(part->layer, TRUE);
    gimp_drawable_update(part->layer, part->x, part->y, part->width, part->height);
    return part->layer;
}

/* Makes a new image of the mosaic, as large as it was drawn. */
static gint32 make_image(const Part *part, GdkPixbuf *made)
{
    const gint width = gdk_pixbuf_get_width(made), height = gdk_pixbuf_get_height(made);
    gdouble x_resolution, y_resolution;
    gimp_image_get_resolution(part->image, &x_resolution, &y_resolution);
    const gint32 image = gimp_image_new(width, height, GIMP_RGB);
    gimp_image_undo_disable(image);
    gimp_image_set_resolution(image, x_resolution, y_resolution);
    const gint32 layer =
        gimp_layer_new(image, "", part->width, part->height, GIMP_RGBA_IMAGE, 100, GIMP_LAYER_MODE_NORMAL);
    name_after(layer, part);
    gimp_image_insert_layer(image, layer, -1, 0);
    mask_as_source(layer, part);
    /* Scales the mask; there are no pixels yet. */
    gimp_layer_scale(layer, width, height, FALSE);
    paint(layer, made);
    gimp_image_undo_enable(image);
    return layer;
}

/* A layer without transparency keeps its pixels where the mosaic is clear. */
static GdkPixbuf *over_pixels(const Part *part, GdkPixbuf *made, GError **error)
{
    GdkPixbuf *whole = pixels_of(part, error);
    if (whole)
        gdk_pixbuf_composite(made, whole, 0, 0, part->width, part->height, 0, 0,
                             (gdouble)part->width / gdk_pixbuf_get_width(made),
                             (gdouble)part->height / gdk_pixbuf_get_height(made), GDK_INTERP_BILINEAR, 255);
    g_object_unref(made);
    return whole;
}

static void show_progress(const gchar *doing, gdouble share)
{
    static const gchar *last;
    if (doing != last)
        gimp_progress_set_text(doing);
    last = doing;
    gimp_progress_update(share);
}

/* Makes the mosaic; the layer that has it, or -1 and an error. */
static gint32 make_mosaic(const Part *part, const gchar *program, const Options *options, GError **error)
{
    const gboolean is_for_layer = options->scale == 1, replaces = is_for_layer && !options->on_new_layer;
    const gint output_side_px = scaled(MAX(part->width, part->height), options);
    if (output_side_px > OUTPUT_SIDE_MAX_PX) {
        refuse(error, "The result would have a side of %d px, and %d px is the most", output_side_px,
               OUTPUT_SIDE_MAX_PX);
        return -1;
    }
    if (replaces && gimp_item_get_lock_content(part->layer)) {
        refuse(error, "The layer's pixels are locked; unlock them, or lay the mosaic on a new layer");
        return -1;
    }
    gimp_progress_init("Laying tiles");
    GdkPixbuf *picture = pixels_of(part, error);
    if (!picture)
        return -1;
    if (part->is_selected)
        clear_unselected(part, picture);
    GdkPixbuf *made = evolve(program, picture, options, output_side_px, show_progress, error);
    if (made && replaces && gdk_pixbuf_get_has_alpha(made) && !gimp_drawable_has_alpha(part->layer))
        made = over_pixels(part, made, error);
    /* Without a progress there is nothing to cancel, and what follows is done whole. */
    gimp_progress_end();
    if (!made)
        return -1;

    gint32 layer;
    if (is_for_layer) {
        gimp_image_undo_group_start(part->image);
        layer = replaces ? replace(part, made) : lay_above(part, made);
        gimp_image_undo_group_end(part->image);
    } else {
        layer = make_image(part, made);
    }
    g_object_unref(made);
    return layer;
}

/* The options of this call; FALSE and no error if the person has cancelled. */
static gboolean choose_options(GimpRunMode mode, gint count, const GimpParam *given, const Part *part,
                               Options *options, GError **error)
{
    *options = DEFAULTS;
    if (mode == GIMP_RUN_NONINTERACTIVE)
        return read_options(count, given, options, error);
    /* What another version of this plug-in has left may be of another shape. */
    if (gimp_get_data_size(PROCEDURE) == sizeof *options)
        gimp_get_data(PROCEDURE, options);
    if (mode == GIMP_RUN_INTERACTIVE) {
        if (!ask(options, part->width, part->height))
            return FALSE;
        gimp_set_data(PROCEDURE, options, sizeof *options);
    }
    return TRUE;
}

static void run(G_GNUC_UNUSED const gchar *name, gint count, const GimpParam *given, gint *return_count,
                GimpParam **returned)
{
    static GimpParam values[2];
    const GimpRunMode mode = given[0].data.d_int32;
    GError *error = NULL;
    Part part;
    Options options;
    gint32 layer = -1;
    gegl_init(NULL, NULL);
    gchar *program = find_program(own_path, &error);
    if (program && find_part(given[1].data.d_image, given[2].data.d_drawable, &part, &error) &&
        choose_options(mode, count, given, &part, &options, &error))
        layer = make_mosaic(&part, program, &options, &error);
    if (layer != -1 && mode != GIMP_RUN_NONINTERACTIVE) {
        if (gimp_item_get_image(layer) != part.image)
            gimp_display_new(gimp_item_get_image(layer));
        gimp_displays_flush();
    }
    g_free(program);

    *returned = values;
    *return_count = 2;
    values[0].type = GIMP_PDB_STATUS;
    if (layer != -1) {
        values[0].data.d_status = GIMP_PDB_SUCCESS;
        values[1].type = GIMP_PDB_LAYER;
        values[1].data.d_layer = layer;
    } else if (error) {
        values[0].data.d_status = GIMP_PDB_EXECUTION_ERROR;
        values[1].type = GIMP_PDB_STRING;
        values[1].data.d_string = error->message;
    } else {
        values[0].data.d_status = GIMP_PDB_CANCEL;
        *return_count = 1;
    }
}

const GimpPlugInInfo PLUG_IN_INFO = {NULL, NULL, query, run};

/* In place of MAIN(), which does not tell where the plug-in lies. */
int main(int argc, char *argv[])
{
    own_path = argv[0];
    return gimp_main(&PLUG_IN_INFO, argc, argv);
}
